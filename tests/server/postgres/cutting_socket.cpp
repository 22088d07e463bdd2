// Forwards bytes, and looks for COMMIT in those of the client.
#include "tests/server/postgres/cutting_socket.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <cstring>
#include <string_view>

namespace varimesh::server::testing {
namespace {

constexpr char kName[] = ".s.PGSQL.5432";

sockaddr_un address_of(const std::filesystem::path& folder) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string path = (folder / kName).string();
  std::memcpy(address.sun_path, path.c_str(), std::min(path.size(), sizeof address.sun_path - 1));
  return address;
}

bool send_all(int to, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = ::send(to, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(sent));
  }
  return true;
}

}  // namespace

CuttingSocket::CuttingSocket(std::filesystem::path server) : server_(std::move(server)) {
  std::string name = std::filesystem::temp_directory_path() / "varimesh-cut-XXXXXX";
  folder_ = ::mkdtemp(name.data());
  listen();
  thread_ = std::thread([this] { accept(); });
}

CuttingSocket::~CuttingSocket() {
  closing_ = true;
  thread_.join();
  for (std::thread& connection : connections_) connection.join();
  ::close(listener_);
  std::filesystem::remove_all(folder_);
}

void CuttingSocket::listen() {
  const sockaddr_un address = address_of(folder_);
  listener_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  ::bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof address);
  ::listen(listener_, 64);
}

void CuttingSocket::set_open(bool open) { open_ = open; }

void CuttingSocket::accept() {
  while (!closing_) {
    pollfd waited{listener_, POLLIN, 0};
    if (::poll(&waited, 1, 20) <= 0) continue;
    const int client = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    if (client < 0) continue;
    if (!open_) {
      ::close(client);
      continue;
    }
    std::lock_guard lock(mutex_);
    connections_.emplace_back([this, client] { serve(client); });
  }
}

void CuttingSocket::serve(int client) {
  const sockaddr_un address = address_of(server_);
  const int server = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (::connect(server, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) {
    std::array<char, 65536> bytes;
    while (!closing_ && open_) {
      std::array<pollfd, 2> waited{pollfd{client, POLLIN, 0}, pollfd{server, POLLIN, 0}};
      if (::poll(waited.data(), waited.size(), 20) <= 0) continue;
      if (waited[0].revents != 0 && !forward(client, server)) break;
      if (waited[1].revents == 0) continue;
      const ssize_t got = ::recv(server, bytes.data(), bytes.size(), 0);
      if (got <= 0 || !send_all(client, {bytes.data(), static_cast<std::size_t>(got)})) break;
    }
  }
  ::close(server);
  ::close(client);
}

bool CuttingSocket::forward(int client, int server) {
  std::array<char, 65536> bytes;
  const ssize_t got = ::recv(client, bytes.data(), bytes.size(), 0);
  if (got <= 0) return false;
  const std::string_view sent(bytes.data(), static_cast<std::size_t>(got));
  if (sent.find("COMMIT") == std::string_view::npos) return send_all(server, sent);
  const Cut when = cut_.exchange(Cut::Never);
  if (when == Cut::Never) return send_all(server, sent);
  if (when == Cut::AfterCommitForGood) open_ = false;
  ++cuts_;
  if (when != Cut::BeforeCommit) {
    send_all(server, sent);
    ::recv(server, bytes.data(), bytes.size(), 0);  // waits until it is done
  }
  return false;
}

}  // namespace varimesh::server::testing
