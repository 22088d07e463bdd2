// Listens and answers with civetweb.
#include "server/http/listen.h"

#include <civetweb.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cstring>

#include "server/addresses.h"

namespace varimesh::server {
namespace {

/// How long one request may take to come, in milliseconds. Requests come from this machine or its network, so they come
/// at once. Connections that say nothing keep a thread each: n of them hold the others up for n / kHttpThreads × 2 s.
constexpr const char* kRequestTimeout = "2000";

/// A page may load only its own server's files and must not execute markup from job data.
constexpr const char* kPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'";

using Clock = std::chrono::steady_clock;

/// Sends a body, or a part of one. A client that takes nothing for two seconds is given up, and so is one that has not
/// all of it at the deadline. Returns whether it has.
bool send_body(mg_connection* connection, std::string_view body, Clock::time_point deadline) {
  constexpr std::size_t kPiece = std::size_t{8} << 10;
  while (!body.empty()) {
    if (Clock::now() >= deadline) return false;
    const int sent = mg_write(connection, body.data(), std::min(kPiece, body.size()));
    if (sent <= 0) return false;
    body.remove_prefix(static_cast<std::size_t>(sent));
  }
  return true;
}

/// Sends what stands before a body of this size. Returns whether the client wants the body too.
bool send_head(mg_connection* connection, int status, std::string_view type, std::size_t size, const char* more) {
  const bool head = std::strcmp(mg_get_request_info(connection)->request_method, "HEAD") == 0;
  mg_printf(connection,
            "HTTP/1.1 %d %s\r\nContent-Type: %.*s\r\nContent-Length: %zu\r\nCache-Control: no-store\r\n"
            "Content-Security-Policy: %s\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n"
            "Cross-Origin-Resource-Policy: same-origin\r\nConnection: close\r\n%s\r\n",
            status, mg_get_response_code_text(connection, status), static_cast<int>(type.size()), type.data(), size,
            kPolicy, more);
  return !head;
}

/// The address as civetweb takes it.
Expected<std::string> numeric_address(const std::string& address, const std::string& flag) {
  if (address.empty()) return address;
  const auto colon = address.rfind(':');
  unsigned port = 65536;
  if (colon != std::string::npos) {
    const char* const end = address.data() + address.size();
    const auto read = std::from_chars(address.data() + colon + 1, end, port);
    if (read.ec != std::errc() || read.ptr != end) port = 65536;
  }
  if (port > 65535 || colon == 0)
    return bad_option("'" + address + "' is not an address with a port from 0 to 65535; write " + flag +
                      " 127.0.0.1:9464.");
  const std::string host = address.substr(0, colon);
  return (host == "localhost" ? "127.0.0.1" : host) + ":" + std::to_string(port);
}

/// `address`: empty if only what encrypts was to get a port.
tl::unexpected<Error> cannot_listen(const std::string& address, const std::string& flag, const std::string& threads) {
  const std::string inside = "Cannot begin to listen for --https: the system refuses a port of 127.0.0.1 or " +
                             threads + " threads, which it needs; raise the limits (ulimit -u, ulimit -n).";
  const std::string taken = "Cannot listen on " + address + " for " + flag +
                            ": the address is taken, or it is not an address of this machine; choose another (port 0 "
                            "is any free port).";
  return tl::unexpected(Error{Error::Kind::Output, address.empty() ? inside : taken});
}

}  // namespace

void send_http(mg_connection* connection, int status, std::string_view type, std::string_view body, const char* more,
               std::chrono::milliseconds patience) {
  if (send_head(connection, status, type, body.size(), more)) send_body(connection, body, Clock::now() + patience);
}

const PageFile* find_page_file(std::span<const PageFile> files, std::string_view path) {
  const auto file = std::ranges::find(files, path, &PageFile::path);
  return file == files.end() ? nullptr : &*file;
}

void send_page_file(mg_connection* connection, const PageFile& file) {
  std::size_t size = 0;
  for (const std::string_view* part : file.parts) size += part->size();
  constexpr std::chrono::seconds kPatience{5};
  const auto deadline = Clock::now() + kPatience;
  if (!send_head(connection, 200, file.type, size, "")) return;
  for (const std::string_view* part : file.parts)
    if (!send_body(connection, *part, deadline)) return;
}

bool is_own_host(const char* host) {
  if (host == nullptr) return false;
  std::string_view name = host;
  const auto bracket = name.find(']');
  const auto colon = name.find(':', bracket == std::string_view::npos ? 0 : bracket);
  if (colon != std::string_view::npos) {
    for (const char c : name.substr(colon + 1))
      if (c < '0' || c > '9') return false;
    name = name.substr(0, colon);
  }
  return name == "localhost" || name == "[::1]" ||
         (name.rfind("127.", 0) == 0 && is_loopback(std::string(name) + ":0"));
}

Expected<void> HttpServer::listen(const std::string& address, const std::string& flag, int (*handle)(mg_connection*),
                                  void* user, int threads, Behind behind) {
  const auto numeric = numeric_address(address, flag);
  if (!numeric) return tl::unexpected(numeric.error());
  const std::string inside = behind == Behind::Tls ? "127.0.0.1:0" : "";
  const std::string ports_wanted = *numeric + (numeric->empty() || inside.empty() ? "" : ",") + inside;
  const std::string count = std::to_string(threads);
  // There is no document root, so files of the disk are never served.
  const char* options[] = {"listening_ports",    ports_wanted.c_str(), "num_threads", count.c_str(),
                           "request_timeout_ms", kRequestTimeout,      nullptr};
  mg_callbacks callbacks{};
  callbacks.begin_request = handle;
  callbacks.log_message = [](const mg_connection*, const char*) { return 1; };  // not to standard error
  context_ = mg_start(&callbacks, user, options);
  std::array<mg_server_port, 2> ports{};
  const int wanted = (address.empty() ? 0 : 1) + (inside.empty() ? 0 : 1);
  if (context_ == nullptr || mg_get_server_ports(context_, static_cast<int>(ports.size()), ports.data()) != wanted)
    return cannot_listen(address, flag, count);
  if (!inside.empty()) port_behind_ = ports[static_cast<std::size_t>(wanted - 1)].port;
  if (!address.empty()) address_ = address.substr(0, address.rfind(':')) + ":" + std::to_string(ports[0].port);
  return {};
}

HttpServer::~HttpServer() {
  if (context_ != nullptr) mg_stop(context_);
}

}  // namespace varimesh::server
