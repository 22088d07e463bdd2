// Writes all bytes to a file: handles what ::write() leaves to its caller, signals and partial writes.
#pragma once

#include <unistd.h>

#include <cerrno>
#include <string_view>

namespace varimesh {

/// Writes all bytes to a file descriptor in blocking mode. Returns false and sets errno if the system refuses them.
inline bool write_all(int file, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(file, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written == 0) errno = EIO;
    if (written <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

/// The same at this byte of the file, whatever its position is. Several threads may write at the same time.
inline bool write_all_at(int file, std::string_view bytes, off_t at) {
  while (!bytes.empty()) {
    const ssize_t written = ::pwrite(file, bytes.data(), bytes.size(), at);
    if (written < 0 && errno == EINTR) continue;
    if (written == 0) errno = EIO;
    if (written <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(written));
    at += written;
  }
  return true;
}

}  // namespace varimesh
