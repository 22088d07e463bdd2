#include "server/isolation/channel.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <utility>

namespace varimesh::server {
namespace {

constexpr std::size_t kHead = sizeof(std::uint32_t);
/// What one call receives at most.
constexpr std::size_t kPiece = std::size_t{256} << 10;
/// What one message may bring along. More descriptors are closed.
constexpr std::size_t kMostFiles = 4;

/// Room for descriptors beside the bytes of a message.
union Control {
  cmsghdr head;
  char bytes[CMSG_SPACE(kMostFiles * sizeof(int))];
};

}  // namespace

Channel::~Channel() {
  if (file_ >= 0) ::close(file_);
  ::close(socket_);
}

bool Channel::send(const google::protobuf::MessageLite& message, int file) {
  const std::size_t size = message.ByteSizeLong();
  if (size > kMostFrameBytes) return false;
  std::string bytes(kHead + size, '\0');
  const auto length = static_cast<std::uint32_t>(size);
  std::memcpy(bytes.data(), &length, kHead);
  message.SerializeWithCachedSizesToArray(reinterpret_cast<std::uint8_t*>(bytes.data() + kHead));
  const std::scoped_lock lock(sending_);
  for (std::size_t sent = 0; sent < bytes.size();) {
    iovec part{bytes.data() + sent, bytes.size() - sent};
    msghdr head{};
    head.msg_iov = &part;
    head.msg_iovlen = 1;
    Control control{};
    if (sent == 0 && file >= 0) {
      head.msg_control = control.bytes;
      head.msg_controllen = CMSG_SPACE(sizeof(int));
      cmsghdr* const with = CMSG_FIRSTHDR(&head);
      with->cmsg_level = SOL_SOCKET;
      with->cmsg_type = SCM_RIGHTS;
      with->cmsg_len = CMSG_LEN(sizeof(int));
      std::memcpy(CMSG_DATA(with), &file, sizeof(int));
    }
    const ssize_t n = ::sendmsg(socket_, &head, MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    sent += static_cast<std::size_t>(n);
  }
  return true;
}

bool Channel::is_closed() const {
  pollfd socket{socket_, 0, 0};
  return ::poll(&socket, 1, 0) > 0 && (socket.revents & POLLHUP) != 0;
}

Channel::Got Channel::receive(google::protobuf::MessageLite& message, int milliseconds,
                              const std::function<bool(std::string_view)>& accept) {
  while (true) {
    const std::size_t there = received_.size() - begin_;
    if (there >= kHead) {
      std::uint32_t size = 0;
      std::memcpy(&size, received_.data() + begin_, kHead);
      if (size > kMostFrameBytes) return Got::Breach;
      if (there >= kHead + size) {
        const char* const bytes = received_.data() + begin_ + kHead;
        const bool good = (!accept || accept({bytes, size})) && message.ParseFromArray(bytes, static_cast<int>(size));
        begin_ += kHead + size;
        if (begin_ == received_.size()) received_.clear(), begin_ = 0;
        return good ? Got::Message : Got::Breach;
      }
    }
    if (const Got got = fill(milliseconds); got != Got::Message) return got;
  }
}

Channel::Got Channel::fill(int milliseconds) {
  pollfd socket{socket_, POLLIN, 0};
  const int ready = ::poll(&socket, 1, milliseconds);
  if (ready == 0 || (ready < 0 && errno == EINTR)) return Got::Nothing;
  if (ready < 0) return Got::End;
  received_.erase(0, std::exchange(begin_, 0));
  const std::size_t before = received_.size();
  received_.resize(before + kPiece);
  iovec part{received_.data() + before, kPiece};
  Control control{};
  msghdr head{};
  head.msg_iov = &part;
  head.msg_iovlen = 1;
  head.msg_control = control.bytes;
  head.msg_controllen = sizeof control.bytes;
  const ssize_t n = ::recvmsg(socket_, &head, MSG_CMSG_CLOEXEC | MSG_DONTWAIT);
  received_.resize(before + static_cast<std::size_t>(n > 0 ? n : 0));
  if (n < 0) return errno == EAGAIN || errno == EINTR ? Got::Nothing : Got::End;
  for (cmsghdr* with = CMSG_FIRSTHDR(&head); with != nullptr; with = CMSG_NXTHDR(&head, with)) {
    if (with->cmsg_level != SOL_SOCKET || with->cmsg_type != SCM_RIGHTS) continue;
    for (std::size_t i = 0; CMSG_LEN((i + 1) * sizeof(int)) <= with->cmsg_len; ++i) {
      if (file_ >= 0) ::close(file_);
      std::memcpy(&file_, CMSG_DATA(with) + i * sizeof(int), sizeof(int));
    }
  }
  return n == 0 ? Got::End : Got::Message;
}

int Channel::take_file() { return std::exchange(file_, -1); }

void Channel::limit_sending(int seconds) {
  const timeval limit{seconds, 0};
  ::setsockopt(socket_, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
}

}  // namespace varimesh::server
