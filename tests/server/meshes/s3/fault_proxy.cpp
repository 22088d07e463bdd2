// One thread for each connection.
#include "tests/server/meshes/s3/fault_proxy.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cassert>
#include <string>
#include <string_view>

#include "tests/server/meshes/s3/signature.h"

namespace varimesh::server::testing {
namespace {

sockaddr_in loopback(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
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

constexpr std::string_view kUnavailable =
    "HTTP/1.1 503 Slow Down\r\nContent-Length: 50\r\nConnection: close\r\n\r\n"
    "<Error><Code>SlowDown</Code><M>x</M></Error>......";

constexpr std::string_view kForbidden =
    "HTTP/1.1 403 Forbidden\r\nContent-Length: 50\r\nConnection: close\r\n\r\n"
    "<Error><Code>SignatureDoesNotMatch</Code></Error>.";

}  // namespace

FaultProxy::FaultProxy(int server_port) : server_port_(server_port), listener_(::socket(AF_INET, SOCK_STREAM, 0)) {
  sockaddr_in address = loopback(0);
  socklen_t size = sizeof address;
  [[maybe_unused]] const int bound = ::bind(listener_, reinterpret_cast<const sockaddr*>(&address), size);
  [[maybe_unused]] const int listening = ::listen(listener_, 64);
  assert(bound == 0 && listening == 0);
  ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size);
  port_ = ntohs(address.sin_port);
  accepting_ = std::thread([this] { accept(); });
}

FaultProxy::~FaultProxy() {
  closing_ = true;
  accepting_.join();
  for (std::thread& thread : threads_) thread.join();
  ::close(listener_);
}

bool FaultProxy::take(std::atomic<int>& left) {
  int before = left;
  while (before > 0 && !left.compare_exchange_weak(before, before - 1)) continue;
  if (before <= 0) return false;
  ++faults_;
  return true;
}

void FaultProxy::accept() {
  while (!closing_) {
    pollfd waiting{listener_, POLLIN, 0};
    if (::poll(&waiting, 1, 20) <= 0) continue;
    const int client = ::accept(listener_, nullptr, nullptr);
    if (client < 0) continue;
    if (is_away_) {
      ++faults_;
      ::close(client);
      continue;
    }
    threads_.emplace_back([this, client] { serve(client); });
  }
}

std::string_view FaultProxy::answer_to(std::string_view request) {
  // Heads come whole, since they are short; what else comes is the rest of a body.
  const std::string_view line = request.substr(0, request.find("\r\n"));
  if (!line.ends_with(" HTTP/1.1")) return {};
  if (line.find("partNumber=") != std::string_view::npos) ++parts_;
  if (!is_signed(request.substr(0, request.find("\r\n\r\n") + 4), "S3RVER")) {
    ++wrong_signatures_;
    return kForbidden;
  }
  return take(refusals_) ? kUnavailable : std::string_view();
}

void FaultProxy::serve(int client) {
  const int server = ::socket(AF_INET, SOCK_STREAM, 0);
  const sockaddr_in address = loopback(server_port_);
  bool open = ::connect(server, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  std::string buffer(64 * 1024, '\0');
  std::int64_t sent = 0, answered = 0;
  while (open && !closing_ && !is_away_) {
    pollfd ends[2] = {{client, POLLIN, 0}, {server, POLLIN, 0}};
    if (::poll(ends, 2, 20) <= 0) continue;
    if ((ends[0].revents & (POLLIN | POLLHUP)) != 0) {
      const ssize_t got = ::recv(client, buffer.data(), buffer.size(), 0);
      if (got <= 0 || (request_cuts_ > 0 && sent + got > cut_requests_after_ && take(request_cuts_))) break;
      const std::string_view answer = answer_to(std::string_view(buffer.data(), static_cast<std::size_t>(got)));
      if (!answer.empty()) {
        send_all(client, answer);
        break;
      }
      sent += got;
      open = send_all(server, std::string_view(buffer.data(), static_cast<std::size_t>(got)));
    }
    if ((ends[1].revents & (POLLIN | POLLHUP)) != 0) {
      if (stalls_ > 0 && take(stalls_))
        for (int waited = 0; waited < stall_milliseconds_ && !closing_; waited += 20) ::usleep(20'000);
      const ssize_t got = ::recv(server, buffer.data(), buffer.size(), 0);
      if (got <= 0 || take(lost_answers_)) break;
      auto pass = static_cast<std::size_t>(got);
      if (pass == buffer.size() && take(flips_)) buffer[pass / 2] ^= 1;
      const bool is_cut = cuts_ > 0 && answered + got > cut_after_ && take(cuts_);
      if (is_cut) pass = static_cast<std::size_t>(std::max<std::int64_t>(cut_after_ - answered, 0));
      answered += got;
      open = send_all(client, std::string_view(buffer.data(), pass)) && !is_cut;
    }
  }
  ::close(client);
  ::close(server);
}

}  // namespace varimesh::server::testing
