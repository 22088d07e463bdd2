// One thread polls all connections.
#include "tests/faults/cutting_proxy.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace varimesh::server::testing {
namespace {

using Clock = std::chrono::steady_clock;
/// A client that sends nothing for this long waits for an answer.
constexpr auto kQuiet = std::chrono::milliseconds(100);

sockaddr_un address_of(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
  return address;
}

bool write_all(int to, const char* data, ssize_t size) {
  while (size > 0) {
    const ssize_t written = ::send(to, data, static_cast<std::size_t>(size), MSG_NOSIGNAL);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    data += written;
    size -= written;
  }
  return true;
}

}  // namespace

struct CuttingProxy::Connection {
  Connection(int given_client, int given_server, std::int64_t given_limit)
      : client(given_client), server(given_server), limit(given_limit) {}
  ~Connection() {
    ::close(client);
    ::close(server);
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  const int client, server;
  const std::int64_t limit;
  std::int64_t handed_on = 0, held = 0;
  Clock::time_point heard = Clock::now();  ///< Time of the last data from the client.
};

CuttingProxy::CuttingProxy(std::filesystem::path listen, std::filesystem::path server, std::int64_t longest)
    : path_(std::move(listen)),
      server_(std::move(server)),
      longest_(longest),
      listener_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  const sockaddr_un address = address_of(path_);
  if (listener_ < 0 || ::bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      ::listen(listener_, 16) != 0)
    std::perror(path_.c_str()), std::exit(1);
  thread_ = std::thread([this] { run(); });
}

CuttingProxy::~CuttingProxy() {
  closing_ = true;
  thread_.join();
  ::close(listener_);
}

void CuttingProxy::accept() {
  const int client = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
  if (client < 0) return;
  const int server = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const sockaddr_un address = address_of(server_);
  auto connection =
      std::make_unique<Connection>(client, server, std::uniform_int_distribution<std::int64_t>(1, longest_)(random_));
  if (::connect(server, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0)
    connections_.push_back(std::move(connection));
}

bool CuttingProxy::serve(Connection& connection, short client_events, short server_events) {
  static std::array<char, 256 * 1024> buffer;
  if (server_events != 0) {
    const ssize_t got = ::read(connection.server, buffer.data(), buffer.size());
    if (got <= 0 || !write_all(connection.client, buffer.data(), got)) return false;
  }
  if (client_events != 0) {
    const ssize_t got = ::read(connection.client, buffer.data(), buffer.size());
    if (got <= 0) return false;
    connection.heard = Clock::now();
    const ssize_t passes = std::min<std::int64_t>(got, connection.limit - connection.handed_on);
    if (!write_all(connection.server, buffer.data(), passes)) return false;
    connection.handed_on += passes;
    connection.held += got - passes;
  }
  if (connection.held == 0 || Clock::now() - connection.heard < kQuiet) return true;
  most_held_ = std::max(most_held_.load(), connection.held);
  ++cuts_;
  return false;
}

void CuttingProxy::run() {
  while (!closing_) {
    std::vector<pollfd> files{{listener_, POLLIN, 0}};
    for (const auto& connection : connections_) {
      files.push_back({connection->client, POLLIN, 0});
      files.push_back({connection->server, POLLIN, 0});
    }
    ::poll(files.data(), files.size(), 20);
    for (std::size_t i = connections_.size(); i-- > 0;)
      if (!serve(*connections_[i], files[2 * i + 1].revents, files[2 * i + 2].revents))
        connections_.erase(connections_.begin() + static_cast<std::ptrdiff_t>(i));
    if (files[0].revents != 0) accept();
  }
  connections_.clear();
}

}  // namespace varimesh::server::testing
