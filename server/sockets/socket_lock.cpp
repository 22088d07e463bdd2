// Locks a file beside the socket, and asks the socket whether somebody listens.
#include "server/sockets/socket_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string_view>

namespace varimesh::server {
namespace {

/// Returns the path of unix:PATH or unix:///PATH.
std::string path_of(const std::string& address) {
  constexpr std::string_view scheme = "unix:";
  const std::string path = address.substr(scheme.size());
  return path.starts_with("//") ? path.substr(2) : path;
}

/// Whether a process accepts connections on a socket.
bool has_listener(const std::string& path) {
  sockaddr_un name{};
  name.sun_family = AF_UNIX;
  if (path.size() >= sizeof name.sun_path) return false;
  std::memcpy(name.sun_path, path.data(), path.size());
  const int probe = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (probe < 0) return false;
  // EAGAIN: there is a listener, and its queue is full. EACCES, EPERM: it is the socket of another user.
  const bool heard = ::connect(probe, reinterpret_cast<const sockaddr*>(&name), sizeof name) == 0 || errno == EAGAIN ||
                     errno == EACCES || errno == EPERM;
  ::close(probe);
  return heard;
}

/// Opens and locks the file. −1 if that fails (errno); EWOULDBLOCK: another process has the lock.
int lock_file(const std::string& path) {
  while (true) {
    const int file = ::open(path.c_str(), O_CREAT | O_RDWR | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (file < 0) return -1;
    struct stat opened {
    }, named{};
    if (::flock(file, LOCK_EX | LOCK_NB) != 0) {
      const int reason = errno;
      ::close(file);
      errno = reason;
      return -1;
    }
    // The previous owner may have removed the file after it was opened here; then a lock on it protects nothing.
    if (::fstat(file, &opened) == 0 && ::lstat(path.c_str(), &named) == 0 && opened.st_ino == named.st_ino &&
        opened.st_dev == named.st_dev)
      return file;
    ::close(file);
  }
}

}  // namespace

Expected<std::unique_ptr<SocketLock>> SocketLock::take(const std::string& address) {
  const auto refuse = [&](const std::string& why) {
    return tl::unexpected(Error{Error::Kind::Output, "Cannot listen on " + address + ": " + why});
  };
  constexpr const char* kTaken = "another process listens there; stop it, or choose another socket (--listen).";
  const std::string socket = path_of(address), path = socket + ".lock";
  const int file = lock_file(path);
  if (file < 0 && errno == EWOULDBLOCK) return refuse(kTaken);
  if (file < 0)
    return refuse("its lock file " + path + " cannot be created (" + std::strerror(errno) +
                  "); choose a socket in a folder that exists and that you can write into (--listen).");
  std::unique_ptr<SocketLock> lock(new SocketLock(path, file));
  if (has_listener(socket)) return refuse(kTaken);
  return lock;
}

SocketLock::~SocketLock() {
  ::unlink(path_.c_str());
  ::close(file_);
}

}  // namespace varimesh::server
