#include "core/hdf/socket.h"

#include <unistd.h>

#include <cerrno>

#include "core/formats/hdf5/protocol.h"

namespace varimesh::hdf {

bool receive(void* to, std::size_t bytes) {
  for (auto* at = static_cast<char*>(to); bytes > 0;) {
    const ssize_t n = ::read(formats::hdf5::kSocket, at, bytes);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    at += n;
    bytes -= std::size_t(n);
  }
  return true;
}

bool send(const void* from, std::size_t bytes) {
  for (const auto* at = static_cast<const char*>(from); bytes > 0;) {
    const ssize_t n = ::write(formats::hdf5::kSocket, at, bytes);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    at += n;
    bytes -= std::size_t(n);
  }
  return true;
}

}  // namespace varimesh::hdf
