// What ::write() leaves to its caller: signals, and files that take less than they were given.
#pragma once

#include <unistd.h>

#include <cerrno>
#include <string_view>

namespace varimesh {

/// Writes all of the bytes to the file, which blocks; false, with errno, where the system does not take them.
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

}  // namespace varimesh
