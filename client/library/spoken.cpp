#include "client/library/spoken.h"

#include <fcntl.h>
#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <memory>
#include <string_view>
#include <utility>

namespace varimesh::client {
namespace {

using Clock = std::chrono::steady_clock;

/// A ClientHello of TLS 1.2 (RFC 5246, 7.4.1.2). It offers what a server with a certificate of RSA or ECDSA takes,
/// because servers of gRPC end a handshake that fails without a word.
constexpr std::string_view kClientHello(
    "\x16\x03\x01\x00\x68"                                                      // record: handshake
    "\x01\x00\x00\x64\x03\x03"                                                  // ClientHello, TLS 1.2
    "VariMesh asks what this speaks.."                                          // in place of random bytes
    "\x00"                                                                      // no session
    "\x00\x0e\xc0\x2f\xc0\x2b\xc0\x30\xc0\x2c\xc0\x13\x00\x9c\x00\x2f"          // cipher suites
    "\x01\x00"                                                                  // no compression
    "\x00\x2d"                                                                  // extensions:
    "\x00\x0a\x00\x08\x00\x06\x00\x17\x00\x18\x00\x19"                          // groups
    "\x00\x0b\x00\x02\x01\x00"                                                  // forms of points
    "\x00\x0d\x00\x0e\x00\x0c\x04\x03\x05\x03\x06\x03\x08\x04\x04\x01\x05\x01"  // signatures
    "\x00\x10\x00\x05\x00\x03\x02h2",                                           // HTTP/2
    109);

/// A socket that is closed in the end; −1: there is none.
class Socket {
 public:
  explicit Socket(int descriptor) : descriptor_(descriptor) {}
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  ~Socket() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  int get() const { return descriptor_; }

 private:
  int descriptor_;
};

/// Waits until the socket is ready for `events`. False if the time is over.
bool wait_for(const Socket& socket, short events, Clock::time_point deadline,
              const std::function<bool()>& interrupted) {
  constexpr int kLook = 100;  // ms
  while (Clock::now() < deadline && !(interrupted && interrupted())) {
    pollfd one{socket.get(), events, 0};
    if (const int ready = ::poll(&one, 1, kLook); ready != 0) return ready > 0;
  }
  return false;
}

/// The host and the port of an address such as dns:///example.org:1, [::1]:2 or 127.0.0.1:3.
std::pair<std::string, std::string> parts_of(const std::string& address) {
  const std::size_t begin = address.rfind('/') + 1;  // 0 if there is none
  const std::size_t colon = address.rfind(':');
  if (colon == std::string::npos || colon < begin) return {};
  std::string host = address.substr(begin, colon - begin);
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  return {host, address.substr(colon + 1)};
}

/// Whether there is no socket at unix:PATH or unix://PATH, or one that no process listens on.
bool nobody_listens_on(const std::string& address) {
  std::string_view path = std::string_view(address).substr(sizeof "unix:" - 1);
  if (path.starts_with("//")) path.remove_prefix(2);
  sockaddr_un at{};
  at.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof at.sun_path) return false;
  path.copy(at.sun_path, path.size());
  const Socket socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  return socket.get() >= 0 && ::connect(socket.get(), reinterpret_cast<const sockaddr*>(&at), sizeof at) != 0 &&
         (errno == ENOENT || errno == ECONNREFUSED);
}

Spoken heard_on(const Socket& socket, Clock::time_point deadline, const std::function<bool()>& interrupted) {
  if (!wait_for(socket, POLLOUT, deadline, interrupted)) return Spoken::Unknown;
  int failure = 0;
  socklen_t size = sizeof failure;
  if (::getsockopt(socket.get(), SOL_SOCKET, SO_ERROR, &failure, &size) == 0 && failure == ECONNREFUSED)
    return Spoken::Refused;
  if (::send(socket.get(), kClientHello.data(), kClientHello.size(), MSG_NOSIGNAL) < 0) return Spoken::Unknown;
  std::array<unsigned char, 4> begin{};
  std::size_t had = 0;
  while (had < begin.size() && wait_for(socket, POLLIN, deadline, interrupted)) {
    const ssize_t got = ::recv(socket.get(), begin.data() + had, begin.size() - had, 0);
    if (got <= 0) break;
    had += static_cast<std::size_t>(got);
  }
  constexpr unsigned char kAlert = 0x15, kHandshake = 0x16, kTls = 0x03, kSettings = 0x04;
  if (had >= 2 && (begin[0] == kAlert || begin[0] == kHandshake) && begin[1] == kTls) return Spoken::Tls;
  // A frame of HTTP/2 begins with three bytes of its length and one of its type (RFC 9113, 4.1).
  if (had == begin.size() && begin[0] == 0 && begin[3] == kSettings) return Spoken::Plain;
  return Spoken::Unknown;
}

}  // namespace

Spoken heard_from(const std::string& address, std::chrono::milliseconds patience,
                  const std::function<bool()>& interrupted) {
  if (address.starts_with("unix:")) return nobody_listens_on(address) ? Spoken::Refused : Spoken::Unknown;
  const auto [host, port] = parts_of(address);
  if (host.empty()) return Spoken::Unknown;
  const auto deadline = Clock::now() + patience;
  addrinfo hints{}, *found = nullptr;
  hints.ai_socktype = SOCK_STREAM;
  if (::getaddrinfo(host.c_str(), port.c_str(), &hints, &found) != 0) return Spoken::Unknown;
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> all(found, &::freeaddrinfo);
  bool all_refuse = found != nullptr;
  for (const addrinfo* one = found; one != nullptr; one = one->ai_next) {
    const Socket socket(::socket(one->ai_family, one->ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, one->ai_protocol));
    if (socket.get() < 0) continue;  // this machine does not have this kind of address
    if (::connect(socket.get(), one->ai_addr, one->ai_addrlen) != 0 && errno != EINPROGRESS) {
      all_refuse = all_refuse && errno == ECONNREFUSED;
      continue;
    }
    const Spoken heard = heard_on(socket, deadline, interrupted);
    if (heard == Spoken::Tls || heard == Spoken::Plain) return heard;
    all_refuse = all_refuse && heard == Spoken::Refused;
  }
  return all_refuse ? Spoken::Refused : Spoken::Unknown;
}

}  // namespace varimesh::client
