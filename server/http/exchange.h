// One request over HTTP and its answer, as JSON.
#pragma once

#include <google/protobuf/message.h>
#include <grpcpp/grpcpp.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/failure.h"
#include "server/http/listen.h"
#include "server/resources/pool.h"

struct mg_connection;
struct mg_request_info;

namespace varimesh::server {

/// Bytes of a file.
struct ByteRange {
  std::int64_t first = 0, end = 0;  ///< The bytes from `first` to the one before `end`.
  bool is_part = false;             ///< The client has asked for these bytes by Range.
};

/// Who has sent a request.
struct HttpCaller {
  std::string address;        ///< Without the port.
  std::string certificate;    ///< The common name in the caller's certificate; empty: the caller has shown none.
  bool is_encrypted = false;  ///< Whether the connection is.
};

/// Reads a request and answers it. One thread at a time.
class HttpExchange {
 public:
  /// @param large_texts  a thread that reads and writes large texts of JSON
  HttpExchange(mg_connection* connection, HttpCaller caller, Pool& large_texts);

  /// From now on, the work on the texts of this exchange counts as this caller's work, whichever token the caller
  /// shows.
  void set_peer(std::string peer) { peer_ = std::move(peer); }

  std::string_view method() const;
  /// Without the query; percent signs are decoded.
  std::string_view path() const;
  const HttpCaller& caller() const { return caller_; }
  bool is_encrypted() const { return caller_.is_encrypted; }
  /// A header; empty if it is missing, or has bytes that are no printable ASCII.
  std::string header(const char* name) const;
  /// All headers of this name, as they are.
  std::vector<std::string_view> headers(const char* name) const;
  /// The fields of the query in their order, decoded. INVALID_ARGUMENT if there are too many.
  Answer<std::vector<std::pair<std::string, std::string>>> query() const;

  /// Whether the body is declared to have this type.
  bool has_type(std::string_view type) const;
  /// INVALID_ARGUMENT unless there is a body of this type whose size is known.
  Answer<void> expect(std::string_view type) const;
  /// The size of the body, in bytes; negative if it is not known.
  std::int64_t size() const;
  /// The socket to the client; negative: it was not found.
  int socket();
  /// How long a client may send nothing: a few seconds, or as long as a piece may take.
  enum class Pauses { Short, Long };
  /// Reads this many bytes of the body, which has them. Returns how many came; fewer if the client is gone, or if there
  /// are no more within half a minute.
  std::size_t read_some(char* bytes, std::size_t count, Pauses pauses = Pauses::Long);
  /// Reads a body of JSON into a message. INVALID_ARGUMENT if it is not declared as JSON, has more than `most` bytes,
  /// does not come soon, or is no JSON of this message.
  Answer<void> read(google::protobuf::Message* message, std::size_t most);

  /// Reads JSON into a message. INVALID_ARGUMENT if it is no JSON of this message.
  Answer<void> read_json(const std::string& text, google::protobuf::Message* message);

  /// Gives a call what the request says about its caller.
  void pass_on(grpc::ClientContext& context) const;
  /// Calls a method of this server for the caller of the request, and answers with what it says.
  template <class Stub, class Request, class Response>
  void call(Stub& stub, grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
            const Request& request) {
    constexpr std::chrono::seconds kPatience{60};
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kPatience);
    pass_on(context);
    Response response;
    const grpc::Status status = (stub.*method)(&context, request, &response);
    if (status.ok())
      answer(response);
    else
      refuse(status);
  }

  /// Begins to answer with some bytes of a file of this size. `digest`: if it is empty, a client cannot ask for a part
  /// of the file.
  void begin_bytes(const ByteRange& range, std::int64_t size, const std::string& digest);
  /// Sends some of these bytes. Returns false if the client is gone, or takes none of them for half a minute.
  bool send(std::string_view bytes);
  /// Begins to answer with server-sent events.
  void begin_events();
  /// Sends some text of these events. An empty text ends the answer. Returns what send() would.
  bool send_chunk(std::string_view text);
  /// Answers that there is nothing to send, and that there will be nothing.
  void answer_nothing();
  /// Answers with a message as proto3 JSON.
  void answer(const google::protobuf::Message& message);
  /// Answers with a document of JSON.
  void answer_json(std::string_view text);
  /// Answers with a file of a page.
  void answer_page_file(const PageFile& file);
  /// Answers with the status as google.rpc.Status, and its code as HTTP has it. `http`: another code of HTTP.
  /// `more`: further header lines, each with its end of line.
  void refuse(const grpc::Status& status, int http = 0, const std::string& more = {});

 private:
  /// Does work on a text or message of this size, and waits for it. A processor may need half a second for a large
  /// text. Only one large text is worked on at a time, and callers take turns, so that other requests do not wait for
  /// large texts.
  void in_turn(std::size_t bytes, const std::function<void()>& work);
  /// Whether the client knows chunks: their end shows that nothing is missing.
  bool has_chunks() const;

  mg_connection* const connection_;
  const mg_request_info& request_;
  const HttpCaller caller_;
  Pool& large_texts_;
  std::string peer_;
  std::optional<int> socket_;  ///< Once it was looked for.
};

/// INVALID_ARGUMENT: the query has an unknown field.
Refusal unknown_field(const std::string& name, const std::string& known);

}  // namespace varimesh::server
