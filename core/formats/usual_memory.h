// The memory that reading takes at first. Most files need no more of most_memory_to_read().
#pragma once

#include <cstdint>
#include <string_view>

namespace varimesh::formats {

/// The part of most_memory_to_read() that reading this file does not need, in bytes, if its mesh is an ordinary one.
/// The readers of the formats need different parts.
/// @param bytes  a file, in any format; a file in no known format needs no memory besides itself
std::int64_t seldom_needed_to_read(std::string_view bytes);

}  // namespace varimesh::formats
