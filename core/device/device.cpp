#include "core/device/device.h"

#include <cassert>

namespace varimesh::device {

Possible<Buffer> Device::allocate(std::size_t bytes) {
  if (bytes == 0) return Buffer();
  const auto address = allocate_bytes(bytes);
  if (!address) return tl::unexpected(address.error());
  return Buffer(*this, *address, bytes);
}

std::size_t Buffer::checked(std::size_t bytes) const {
  assert(device_ != nullptr && bytes <= bytes_);
  return bytes;
}

}  // namespace varimesh::device
