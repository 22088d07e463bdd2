// Reads part of a file, however many calls of ::pread() that takes.
#pragma once

#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <string>

namespace varimesh::server {

/// Reads up to `size` bytes from `offset` on into `bytes`; fewer only at the end of the file. Returns false, with
/// errno, if the file cannot be read.
inline bool read_at(int file, std::int64_t offset, std::size_t size, std::string* bytes) {
  bytes->resize(size);
  std::size_t filled = 0;
  while (filled < size) {
    const ssize_t got =
        ::pread(file, bytes->data() + filled, size - filled, offset + static_cast<std::int64_t>(filled));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return false;
    if (got == 0) break;
    filled += static_cast<std::size_t>(got);
  }
  bytes->resize(filled);
  return true;
}

}  // namespace varimesh::server
