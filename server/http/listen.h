// What all HTTP ports share: how they listen and answer.
#pragma once

#include <chrono>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"

struct mg_connection;
struct mg_context;

namespace varimesh::server {

inline constexpr std::string_view kTextType = "text/plain; charset=utf-8", kJsonType = "application/json",
                                  kHtmlType = "text/html; charset=utf-8", kStyleType = "text/css; charset=utf-8",
                                  kScriptType = "text/javascript; charset=utf-8",
                                  kBytesType = "application/octet-stream", kFormType = "multipart/form-data";

/// Threads that read and answer short requests.
inline constexpr int kHttpThreads = 48;

/// Answers a request. `more`: further header lines, each with its end of line. `patience`: how long the client may take
/// for the body.
void send_http(mg_connection* connection, int status, std::string_view type, std::string_view body,
               const char* more = "", std::chrono::milliseconds patience = std::chrono::seconds{30});

/// A file of a page, which is made of embedded parts.
struct PageFile {
  std::string_view path, type;
  std::vector<const std::string_view*> parts;
};

/// The file that has this path; null: there is none.
const PageFile* find_page_file(std::span<const PageFile> files, std::string_view path);

/// Sends a file without copying it. Everybody may fetch it, so the server gives up a client that takes it slowly.
void send_page_file(mg_connection* connection, const PageFile& file);

/// Returns whether a Host header is a loopback name, with or without a port. Null: the request has no Host header.
bool is_own_host(const char* host);

/// Whether something in front of an HTTP server encrypts. It then gets a port of its own: any free port of 127.0.0.1.
enum class Behind { Nothing, Tls };

/// An HTTP server with threads of its own, without files of the disk. It ends with this object. A connection that does
/// not send a whole request keeps one of the threads until a request is given up.
class HttpServer {
 public:
  /// Listens on HOST:PORT, with a numeric HOST or localhost; port 0 is any free port. Empty: there is only the port for
  /// what encrypts. Calls `handle` for each request, which must answer it; `user` is what mg_get_request_info() gives
  /// as its user data. `flag`: who asked for the address, for the messages. `threads`: how many requests are answered
  /// at a time. Errors: BadOption if the address has no port, Output if it is taken or the system refuses a port or
  /// threads.
  Expected<void> listen(const std::string& address, const std::string& flag, int (*handle)(mg_connection*), void* user,
                        int threads = kHttpThreads, Behind behind = Behind::Nothing);
  HttpServer() = default;
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// The address with the port that was chosen.
  const std::string& address() const { return address_; }
  /// The port for what encrypts; 0: there is none.
  int port_behind() const { return port_behind_; }

 private:
  std::string address_;
  int port_behind_ = 0;
  mg_context* context_ = nullptr;
};

}  // namespace varimesh::server
