// An epoll of all connections, each of which does what it can when a socket has changed.
#include "server/https/tls_front.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <spdlog/spdlog.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <set>
#include <sstream>
#include <string_view>
#include <utility>

namespace varimesh::server {
namespace {

/// How many connections there may be, of all clients and of each address; of that fewer than the HTTP server has
/// threads.
constexpr int kMostConnections = 1024, kMostOfAnAddress = 256;

/// How often late clients and changed files are looked for, in milliseconds.
constexpr int kBetweenLooks = 500;
constexpr std::chrono::seconds kBetweenReads{2};

/// Bytes that the system keeps for a client that reads slowly. Without this bound it takes several megabytes.
constexpr int kMostUnsent = 128 << 10, kMostUnread = 128 << 10;

/// What stands for wake_ among the events; no client has this number.
constexpr std::uint64_t kWake = 0;

void set(int socket, int level, int option, int value) { ::setsockopt(socket, level, option, &value, sizeof value); }

std::string text_of(const in_addr& address) {
  std::array<char, INET_ADDRSTRLEN> text{};
  ::inet_ntop(AF_INET, &address, text.data(), text.size());
  return text.data();
}

/// The address of the peer of a socket, without its port; IPv4 in IPv6 is IPv4.
std::string peer_of(int socket) {
  sockaddr_storage peer{};
  socklen_t size = sizeof peer;
  std::array<char, NI_MAXHOST> host{};
  if (::getpeername(socket, reinterpret_cast<sockaddr*>(&peer), &size) != 0 ||
      ::getnameinfo(reinterpret_cast<sockaddr*>(&peer), size, host.data(), host.size(), nullptr, 0, NI_NUMERICHOST) !=
          0)
    return {};
  const std::string text = host.data();
  constexpr std::string_view kMapped = "::ffff:";
  return text.starts_with(kMapped) ? text.substr(kMapped.size()) : text;
}

std::string key_of(const std::string& address, int port) { return address + ":" + std::to_string(port); }

std::string bytes_of(const TlsFiles& files) {
  std::ostringstream bytes;
  for (const std::string& name : {files.certificate, files.key, files.authority})
    if (!name.empty()) bytes << std::ifstream(name, std::ios::binary).rdbuf() << '\0';
  return bytes.str();
}

}  // namespace

TlsFront::TlsFront(TlsFiles files, int port_behind)
    : files_(std::move(files)),
      port_behind_(port_behind),
      places_(kMostConnections),
      places_of_peer_(kMostOfAnAddress),
      bytes_(bytes_of(files_)) {}

Expected<std::unique_ptr<TlsFront>> TlsFront::start(const std::string& address, const TlsFiles& files,
                                                    int port_behind) {
  std::unique_ptr<TlsFront> front(new TlsFront(files, port_behind));
  auto context = tls_context(files);
  if (!context) return tl::unexpected(context.error());
  front->context_ = std::move(*context);
  auto listener = TcpListener::open(address);
  if (!listener) return tl::unexpected(listener.error());
  front->listener_ = std::move(*listener);
  front->address_ = address.substr(0, address.rfind(':')) + ":" + std::to_string(front->listener_->port());
  front->events_ = ::epoll_create1(EPOLL_CLOEXEC);
  front->wake_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  epoll_event waking{EPOLLIN, {.u64 = kWake}};
  if (front->events_ < 0 || ::epoll_ctl(front->events_, EPOLL_CTL_ADD, front->wake_, &waking) != 0)
    return tl::unexpected(Error{Error::Kind::Output, "The system has no descriptors left for " + address + "."});
  TlsFront* const self = front.get();
  front->thread_ = std::thread([self] { self->run(); });
  front->listener_->start([self](int, int socket, const std::string& peer) { self->take(socket, peer); });
  return front;
}

void TlsFront::stop() {
  if (listener_ != nullptr) listener_->stop();
  stopping_ = true;
  if (wake_ >= 0) ::eventfd_write(wake_, 1);
  if (thread_.joinable()) thread_.join();
  const std::scoped_lock lock(mutex_);
  clients_.clear();
  callers_.clear();
}

TlsFront::~TlsFront() {
  stop();
  if (events_ >= 0) ::close(events_);
  if (wake_ >= 0) ::close(wake_);
}

std::optional<TlsFront::Caller> TlsFront::caller(const std::string& address, int port) const {
  const std::scoped_lock lock(mutex_);
  const auto found = callers_.find(key_of(address, port));
  return found == callers_.end() ? std::nullopt : std::optional(found->second);
}

TlsContext TlsFront::context() const {
  const std::scoped_lock lock(mutex_);
  return context_;
}

bool TlsFront::is_named(const std::string& host) const {
  const auto bracket = host.rfind(']');
  const auto colon = host.find(':', bracket == std::string::npos ? 0 : bracket);
  return server::is_named(*context(), host.substr(0, colon));
}

void TlsFront::take(int socket, const std::string& peer) {
  set(socket, IPPROTO_TCP, TCP_NODELAY, 1);
  set(socket, IPPROTO_TCP, TCP_NOTSENT_LOWAT, kMostUnsent);
  Client client{nullptr, places_.take(""), places_of_peer_.take(peer), {}};
  if (client.place == nullptr || client.place_of_peer == nullptr) {
    ::close(socket);
    return;
  }
  const std::scoped_lock lock(mutex_);
  if (stopping_) {
    ::close(socket);
    return;
  }
  const std::uint64_t id = next_id_++;
  client.connection = std::make_unique<TlsConnection>(
      socket, context_,
      [this, id, from = peer_of(socket)](const std::string& certificate) { return open(id, from, certificate); });
  clients_.emplace(id, std::move(client));
  // It can be written at once, so the thread sees it.
  epoll_event changes{EPOLLIN | EPOLLOUT | EPOLLRDHUP | EPOLLET, {.u64 = id}};
  if (::epoll_ctl(events_, EPOLL_CTL_ADD, socket, &changes) != 0) clients_.erase(id);
}

bool TlsFront::has_room_inside() const {
  const std::scoped_lock lock(mutex_);
  return static_cast<long>(callers_.size()) < Admission::most_inside(Admission::descriptor_limit());
}

int TlsFront::open(std::uint64_t id, const std::string& address, const std::string& certificate) {
  if (!has_room_inside()) return -1;
  const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (socket < 0) return -1;
  set(socket, IPPROTO_TCP, TCP_NODELAY, 1);
  set(socket, SOL_SOCKET, SO_RCVBUF, kMostUnread);
  // 127.1.0.0 to 127.254.255.255: sixteen million others come before an address is used again.
  constexpr std::uint32_t kFirst = 0x7f010000, kCount = 254U << 16;
  sockaddr_in from{}, to{};
  from.sin_family = to.sin_family = AF_INET;
  from.sin_addr.s_addr = htonl(kFirst + next_source_++ % kCount);
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  to.sin_port = htons(static_cast<std::uint16_t>(port_behind_));
  socklen_t size = sizeof from;
  epoll_event changes{EPOLLIN | EPOLLOUT | EPOLLRDHUP | EPOLLET, {.u64 = id}};
  bool is_good = ::bind(socket, reinterpret_cast<sockaddr*>(&from), size) == 0 &&
                 ::getsockname(socket, reinterpret_cast<sockaddr*>(&from), &size) == 0 &&
                 ::epoll_ctl(events_, EPOLL_CTL_ADD, socket, &changes) == 0;
  if (is_good) {
    // The server behind must know the caller before it sees the connection.
    const std::scoped_lock lock(mutex_);
    std::string& key = clients_.at(id).key;
    key = key_of(text_of(from.sin_addr), ntohs(from.sin_port));
    is_good = callers_.emplace(key, Caller{address, certificate}).second;
  }
  if (is_good && (::connect(socket, reinterpret_cast<sockaddr*>(&to), sizeof to) == 0 || errno == EINPROGRESS))
    return socket;
  ::close(socket);
  return -1;
}

void TlsFront::run() {
  std::array<epoll_event, 128> changes{};
  auto looked = TlsConnection::Clock::now(), read = looked;
  while (!stopping_) {
    const int count =
        ::epoll_wait(events_, changes.data(), static_cast<int>(changes.size()), busy_.empty() ? kBetweenLooks : 0);
    if (count < 0 && errno != EINTR) return fail(std::strerror(errno));
    std::set<std::uint64_t> turns = std::exchange(busy_, {});
    for (int i = 0; i < count; ++i) turns.insert(changes[static_cast<std::size_t>(i)].data.u64);
    for (const std::uint64_t id : turns) step(id);
    const auto now = TlsConnection::Clock::now();
    if (now - looked >= std::chrono::milliseconds(kBetweenLooks)) {
      looked = now;
      end_late_ones();
    }
    if (now - read >= kBetweenReads) {
      read = now;
      read_files();
    }
  }
}

void TlsFront::fail(const char* reason) {
  spdlog::critical("the port of --https, {}, serves nobody any more: {}; start the server again", address_, reason);
  const std::scoped_lock lock(mutex_);
  stopping_ = true;
  callers_.clear();
  clients_.clear();
}

void TlsFront::step(std::uint64_t id) {
  TlsConnection* connection = nullptr;
  {
    const std::scoped_lock lock(mutex_);
    if (const auto found = clients_.find(id); found != clients_.end()) connection = found->second.connection.get();
  }
  if (connection == nullptr) return;  // it has ended, or this wakes the thread
  switch (connection->step()) {
    case TlsConnection::Next::Wait:
      return;
    case TlsConnection::Next::Again:
      busy_.insert(id);
      return;
    case TlsConnection::Next::End:
      return end(id);
  }
}

void TlsFront::end(std::uint64_t id) {
  const std::scoped_lock lock(mutex_);
  const auto found = clients_.find(id);
  callers_.erase(found->second.key);
  clients_.erase(found);
}

void TlsFront::end_late_ones() {
  const auto now = TlsConnection::Clock::now();
  const std::scoped_lock lock(mutex_);
  for (auto at = clients_.begin(); at != clients_.end();) {
    if (!at->second.connection->is_late(now)) {
      ++at;
      continue;
    }
    callers_.erase(at->second.key);
    at = clients_.erase(at);
  }
}

void TlsFront::read_files() {
  std::string bytes = bytes_of(files_);
  if (bytes == bytes_) return;
  // They may be in the middle of a change; then they are read again.
  Expected<TlsContext> made = tls_context(files_);
  if (!made) return;
  const std::scoped_lock lock(mutex_);
  context_ = std::move(*made);
  bytes_ = std::move(bytes);
}

}  // namespace varimesh::server
