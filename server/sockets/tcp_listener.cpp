// Sockets of the system; the taker gets those that it may have.
#include "server/sockets/tcp_listener.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

namespace varimesh::server {
namespace {

using std::chrono::steady_clock;

/// A connection whose bytes nobody acknowledges ends after this, as gRPC sets it for servers that send pings.
constexpr int kUnacknowledgedMilliseconds = 20'000;
/// How long to wait if the system has no descriptor or no memory for a connection.
constexpr int kPauseMilliseconds = 50;
/// How often the connections of an address are looked at. There may be tens of thousands.
constexpr std::chrono::milliseconds kBetweenLooks{200};
/// How many connections of one socket are accepted before the thread looks at the others, and whether it is to end.
constexpr int kAcceptedAtOnce = 64;

std::uint64_t socket_of(int descriptor) {
  struct stat status {};
  return ::fstat(descriptor, &status) == 0 ? status.st_ino : 0;
}

/// The address without its port. Of IPv6 only the network of 64 bits, since a peer has a whole one; IPv4 in IPv6 is
/// IPv4.
std::string text_of(const sockaddr_storage& peer) {
  char text[INET6_ADDRSTRLEN] = "";
  if (peer.ss_family == AF_INET) {
    ::inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in&>(peer).sin_addr, text, sizeof text);
  } else if (peer.ss_family == AF_INET6) {
    in6_addr address = reinterpret_cast<const sockaddr_in6&>(peer).sin6_addr;
    const bool mapped = IN6_IS_ADDR_V4MAPPED(&address);
    if (!mapped && !IN6_IS_ADDR_LOOPBACK(&address)) std::fill(address.s6_addr + 8, address.s6_addr + 16, 0);
    ::inet_ntop(mapped ? AF_INET : AF_INET6, mapped ? address.s6_addr + 12 : address.s6_addr, text, sizeof text);
  }
  return text;
}

/// Whether a connection comes from the address to which it goes.
bool is_own(int socket, const sockaddr_storage& peer) {
  sockaddr_storage name{};
  socklen_t size = sizeof name;
  if (::getsockname(socket, reinterpret_cast<sockaddr*>(&name), &size) != 0 || name.ss_family != peer.ss_family)
    return false;
  if (name.ss_family == AF_INET6)
    return IN6_ARE_ADDR_EQUAL(&reinterpret_cast<sockaddr_in6&>(name).sin6_addr,
                              &reinterpret_cast<const sockaddr_in6&>(peer).sin6_addr);
  return reinterpret_cast<sockaddr_in&>(name).sin_addr.s_addr ==
         reinterpret_cast<const sockaddr_in&>(peer).sin_addr.s_addr;
}

void set(int socket, int level, int option, int value) { ::setsockopt(socket, level, option, &value, sizeof value); }

/// A socket that listens; −1 if that fails.
int listening_socket(const addrinfo& at, bool both) {
  const int socket = ::socket(at.ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (socket < 0) return -1;
  set(socket, SOL_SOCKET, SO_REUSEADDR, 1);
  set(socket, IPPROTO_TCP, TCP_NODELAY, 1);
  set(socket, IPPROTO_TCP, TCP_USER_TIMEOUT, kUnacknowledgedMilliseconds);
  if (at.ai_family == AF_INET6) set(socket, IPPROTO_IPV6, IPV6_V6ONLY, both ? 0 : 1);
  if (::bind(socket, at.ai_addr, at.ai_addrlen) == 0 && ::listen(socket, SOMAXCONN) == 0) return socket;
  ::close(socket);
  return -1;
}

int port_of(int socket) {
  sockaddr_storage name{};
  socklen_t size = sizeof name;
  if (::getsockname(socket, reinterpret_cast<sockaddr*>(&name), &size) != 0) return 0;
  return ntohs(name.ss_family == AF_INET6 ? reinterpret_cast<sockaddr_in6&>(name).sin6_port
                                          : reinterpret_cast<sockaddr_in&>(name).sin_port);
}

/// Gives all addresses of a list this port.
void set_port(addrinfo& list, int port) {
  for (addrinfo* at = &list; at != nullptr; at = at->ai_next)
    (at->ai_family == AF_INET6 ? reinterpret_cast<sockaddr_in6*>(at->ai_addr)->sin6_port
                               : reinterpret_cast<sockaddr_in*>(at->ai_addr)->sin_port) =
        htons(static_cast<std::uint16_t>(port));
}

/// Whether the list up to `last` has its address already, as some systems list it twice.
bool is_among(const addrinfo& first, const addrinfo& last) {
  for (const addrinfo* at = &first; at != &last; at = at->ai_next)
    if (at->ai_addrlen == last.ai_addrlen && std::memcmp(at->ai_addr, last.ai_addr, last.ai_addrlen) == 0) return true;
  return false;
}

/// The sockets of an address; with port 0 all get the port of the first. Empty if one of them cannot be had.
std::vector<int> listening_sockets(const std::string& host, std::string port, bool both) {
  std::vector<int> sockets;
  addrinfo wanted{};
  wanted.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  wanted.ai_family = both ? AF_INET6 : AF_UNSPEC;
  wanted.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (::getaddrinfo(host.c_str(), port.c_str(), &wanted, &found) != 0) return {};
  bool is_free = true;
  for (const addrinfo* at = found; at != nullptr && is_free; at = at->ai_next) {
    if (is_among(*found, *at)) continue;
    const int socket = listening_socket(*at, both);
    if (socket >= 0 && sockets.empty()) set_port(*found, port_of(socket));
    if (socket >= 0) sockets.push_back(socket);
    // Names may have addresses of other machines, or of IPv6 on a machine without it.
    const bool is_elsewhere = errno == EADDRNOTAVAIL || (at->ai_family == AF_INET6 && errno == EAFNOSUPPORT);
    is_free = socket >= 0 || (is_elsewhere && !both);
  }
  ::freeaddrinfo(found);
  if (is_free) return sockets;
  const int reason = errno;
  for (const int socket : sockets) ::close(socket);
  errno = reason;
  return {};
}

}  // namespace

bool Admission::admits(int descriptor, const std::string& address, long limit) {
  forget(descriptor);  // who had this number before has closed it
  if (descriptor >= limit - reserve(limit)) return false;
  if (count_[address] >= most_of_an_address(limit)) forget_closed(address);
  if (count_[address] >= most_of_an_address(limit)) return false;
  held_[descriptor] = {address, socket_of(descriptor)};
  ++count_[address];
  return true;
}

long Admission::descriptor_limit() {
  rlimit limit{};
  return ::getrlimit(RLIMIT_NOFILE, &limit) == 0 ? static_cast<long>(limit.rlim_cur) : 1024;
}

void Admission::forget(int descriptor) {
  const auto held = held_.find(descriptor);
  if (held == held_.end()) return;
  if (const auto count = count_.find(held->second.address); --count->second == 0) {
    looked_.erase(count->first);
    count_.erase(count);
  }
  held_.erase(held);
}

void Admission::forget_closed(const std::string& address) {
  const auto now = steady_clock::now();
  auto& looked = looked_[address];
  if (now - looked < kBetweenLooks) return;
  looked = now;
  std::vector<int> closed;
  for (const auto& [descriptor, held] : held_)
    if (held.address == address && socket_of(descriptor) != held.socket) closed.push_back(descriptor);
  for (const int descriptor : closed) forget(descriptor);
}

Expected<std::unique_ptr<TcpListener>> TcpListener::open(const std::string& address) {
  const auto colon = address.rfind(':');
  std::string host = address.substr(0, colon);
  if (host.size() > 1 && host.front() == '[') host = host.substr(1, host.size() - 2);
  const std::string port = address.substr(colon + 1);
  const bool both = host == "0.0.0.0" || host == "::";
  std::unique_ptr<TcpListener> listener(new TcpListener);
  listener->listening_ = listening_sockets(both ? "::" : host, port, both);
  if (listener->listening_.empty() && both && errno == EAFNOSUPPORT)
    listener->listening_ = listening_sockets("0.0.0.0", port, false);
  listener->wake_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (listener->listening_.empty() || listener->wake_ < 0)
    return tl::unexpected(Error{Error::Kind::Output, "Cannot listen on " + address +
                                                         ": the address is taken, or it is not an address of this "
                                                         "machine; choose another (port 0 is any free port)."});
  listener->port_ = port_of(listener->listening_.front());
  return listener;
}

TcpListener::~TcpListener() {
  stop();
  for (const int socket : listening_) ::close(socket);
  if (wake_ >= 0) ::close(wake_);
}

void TcpListener::start(Taker taker) {
  taker_ = std::move(taker);
  thread_ = std::thread([this] { run(); });
}

void TcpListener::stop() {
  if (!thread_.joinable()) return;
  const std::uint64_t one = 1;
  while (::write(wake_, &one, sizeof one) < 0 && errno == EINTR) {
  }
  thread_.join();
  for (const int socket : std::exchange(listening_, {})) ::close(socket);
}

bool TcpListener::turned_away(std::chrono::milliseconds window) const {
  const auto when = turned_away_.load();
  return when != 0 && steady_clock::now() - steady_clock::time_point(steady_clock::duration(when)) <= window;
}

void TcpListener::run() {
  std::vector<pollfd> waiting{{wake_, POLLIN, 0}};
  for (const int socket : listening_) waiting.push_back({socket, POLLIN, 0});
  while (true) {
    if (::poll(waiting.data(), waiting.size(), -1) < 0 && errno != EINTR) return;
    if (waiting[0].revents != 0) return;
    bool short_of = false;
    for (std::size_t i = 1; i < waiting.size(); ++i) {
      int accepted = 0;
      while (accepted < kAcceptedAtOnce && accept_from(waiting[i].fd)) ++accepted;
      short_of = short_of || (accepted < kAcceptedAtOnce && errno != EAGAIN && errno != EINTR);
    }
    if (short_of && ::poll(waiting.data(), 1, kPauseMilliseconds) > 0) return;
  }
}

bool TcpListener::accept_from(int listening) {
  sockaddr_storage peer{};
  socklen_t size = sizeof peer;
  const int socket = ::accept4(listening, reinterpret_cast<sockaddr*>(&peer), &size, SOCK_CLOEXEC | SOCK_NONBLOCK);
  if (socket < 0) return false;
  const std::string address = text_of(peer);
  if (admission_.admits(socket, address, Admission::descriptor_limit())) {
    taker_(listening, socket, address);
    return true;
  }
  const auto now = steady_clock::now();
  if (now - warned_ > std::chrono::minutes(1)) {
    warned_ = now;
    spdlog::warn("connections are refused, first one from {}: there are too many for the limit of descriptors",
                 address);
  }
  if (is_own(socket, peer)) turned_away_ = now.time_since_epoch().count();
  ::close(socket);
  return true;
}

}  // namespace varimesh::server
