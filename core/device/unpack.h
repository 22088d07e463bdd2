// Text that the build has compressed.
#pragma once

#include <span>
#include <string>

namespace varimesh::device {

/// The text of a gzip stream that the build has made.
std::string unpack(std::span<const unsigned char> packed);

}  // namespace varimesh::device
