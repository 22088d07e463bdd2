#include "server/http/open_sockets.h"

#include <civetweb.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <string_view>
#include <system_error>

namespace varimesh::server {
namespace {

/// The port of an address of IP; 0: it is another one.
int port_of(const sockaddr_storage& address) {
  if (address.ss_family == AF_INET) return ntohs(reinterpret_cast<const sockaddr_in&>(address).sin_port);
  if (address.ss_family == AF_INET6) return ntohs(reinterpret_cast<const sockaddr_in6&>(address).sin6_port);
  return 0;
}

bool is_address(const sockaddr_storage& address, const char* text) {
  std::array<char, NI_MAXHOST> host{};
  const socklen_t size = address.ss_family == AF_INET ? sizeof(sockaddr_in) : sizeof(sockaddr_in6);
  return ::getnameinfo(reinterpret_cast<const sockaddr*>(&address), size, host.data(), host.size(), nullptr, 0,
                       NI_NUMERICHOST) == 0 &&
         std::string_view(host.data()) == text;
}

}  // namespace

int socket_of(const mg_request_info& request) {
  std::error_code error;
  for (std::filesystem::directory_iterator entry("/proc/self/fd", error), end; !error && entry != end;
       entry.increment(error)) {
    const int file = std::atoi(entry->path().filename().c_str());
    sockaddr_storage here{}, there{};
    socklen_t size = sizeof here, other_size = sizeof there;
    if (::getsockname(file, reinterpret_cast<sockaddr*>(&here), &size) == 0 && port_of(here) == request.server_port &&
        ::getpeername(file, reinterpret_cast<sockaddr*>(&there), &other_size) == 0 &&
        port_of(there) == request.remote_port && is_address(there, request.remote_addr))
      return file;
  }
  return -1;
}

std::shared_ptr<const void> OpenSockets::add(int socket) {
  if (socket < 0) return nullptr;
  const std::scoped_lock lock(mutex_);
  ++open_[socket];
  if (is_down_) ::shutdown(socket, SHUT_RDWR);
  return std::shared_ptr<const void>(this, [this, socket](const void*) {
    const std::scoped_lock lock(mutex_);
    if (--open_[socket] == 0) open_.erase(socket);
  });
}

void OpenSockets::shut_down() {
  const std::scoped_lock lock(mutex_);
  is_down_ = true;
  for (const auto& [socket, count] : open_) ::shutdown(socket, SHUT_RDWR);
}

}  // namespace varimesh::server
