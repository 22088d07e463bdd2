// One request over HTTP and its answer, as JSON.
#pragma once

#include <google/protobuf/message.h>
#include <grpcpp/support/status.h>

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/failure.h"

struct mg_connection;
struct mg_request_info;

namespace varimesh::server {

/// Reads a request and answers it. One thread at a time.
class HttpExchange {
 public:
  explicit HttpExchange(mg_connection* connection);

  std::string_view method() const;
  /// Without the query; percent signs are decoded.
  std::string_view path() const;
  /// The address of the caller.
  std::string address() const;
  /// A header; empty if it is missing, or has bytes that are no printable ASCII.
  std::string header(const char* name) const;
  /// The fields of the query in their order, decoded. INVALID_ARGUMENT if there are too many.
  Answer<std::vector<std::pair<std::string, std::string>>> query() const;

  /// Reads a body of JSON into a message. INVALID_ARGUMENT if it is not declared as JSON, has more than `most` bytes,
  /// does not come soon, or is no JSON of this message.
  Answer<void> read(google::protobuf::Message* message, std::size_t most);

  /// Answers with a message as proto3 JSON.
  void answer(const google::protobuf::Message& message);
  /// Answers with the status as google.rpc.Status, and its code as HTTP has it. `http`: another code of HTTP.
  /// `more`: further header lines, each with its end of line.
  void refuse(const grpc::Status& status, int http = 0, const std::string& more = {});

 private:
  mg_connection* const connection_;
  const mg_request_info& request_;
};

}  // namespace varimesh::server
