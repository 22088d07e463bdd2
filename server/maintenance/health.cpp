// One request of HTTP/1.0, whose answer ends with the connection.
#include "server/maintenance/health.h"

#include <netdb.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <memory>

namespace varimesh::server {
namespace {

/// A connection that closes itself.
class Connection {
 public:
  explicit Connection(int descriptor) : descriptor_(descriptor) {}
  ~Connection() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  int descriptor() const { return descriptor_; }

 private:
  const int descriptor_;
};

/// Returns a connected socket whose steps wait this long at most; -1 if there is none.
int connect_to(const std::string& host, const std::string& port, std::chrono::milliseconds patience) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* list = nullptr;
  if (::getaddrinfo(host.c_str(), port.c_str(), &hints, &list) != 0) return -1;
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owner(list, ::freeaddrinfo);
  timeval time{};
  time.tv_sec = patience.count() / 1000;
  time.tv_usec = patience.count() % 1000 * 1000;
  for (const addrinfo* one = list; one != nullptr; one = one->ai_next) {
    const int descriptor = ::socket(one->ai_family, one->ai_socktype | SOCK_CLOEXEC, one->ai_protocol);
    if (descriptor < 0) continue;
    ::setsockopt(descriptor, SOL_SOCKET, SO_SNDTIMEO, &time, sizeof time);  // connect() waits no longer either
    ::setsockopt(descriptor, SOL_SOCKET, SO_RCVTIMEO, &time, sizeof time);
    if (::connect(descriptor, one->ai_addr, one->ai_addrlen) == 0) return descriptor;
    ::close(descriptor);
  }
  return -1;
}

}  // namespace

Expected<bool> is_ready(const std::string& address, std::chrono::milliseconds patience) {
  const auto colon = address.rfind(':');
  if (colon == std::string::npos || colon + 1 == address.size())
    return bad_option("'" + address + "' is not HOST:PORT; give the address that the server has for --metrics.");
  std::string host = address.substr(0, colon);
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  const Connection connection(connect_to(host, address.substr(colon + 1), patience));
  const auto nobody = [&] {
    return tl::unexpected(
        Error{Error::Kind::Output, "No server answers at " + address + "; start it with --metrics " + address + "."});
  };
  if (connection.descriptor() < 0) return nobody();
  const std::string request = "GET /healthz/ready HTTP/1.0\r\nHost: " + address + "\r\n\r\n";
  if (::send(connection.descriptor(), request.data(), request.size(), MSG_NOSIGNAL) !=
      static_cast<ssize_t>(request.size()))
    return nobody();
  std::string answer;
  char buffer[512];
  // The status is in the first line, "HTTP/1.1 200 OK".
  while (answer.size() < 12) {
    const ssize_t got = ::recv(connection.descriptor(), buffer, sizeof buffer, 0);
    if (got <= 0) return nobody();
    answer.append(buffer, static_cast<std::size_t>(got));
  }
  if (!answer.starts_with("HTTP/1.")) return nobody();
  return answer.substr(8, 4) == " 200";
}

}  // namespace varimesh::server
