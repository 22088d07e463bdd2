// The memory that reading takes at first. Most files need no more of most_memory_to_read().
#pragma once

#include <cstdint>
#include <string_view>

namespace varimesh::formats {

/// How much of most_memory_to_read() a reading of this file can do without, in bytes, if its mesh is an ordinary one:
/// the readers of the formats take different parts of it.
/// @param bytes  a file, in any format; one that is in none needs nothing but the file itself
std::int64_t seldom_needed_to_read(std::string_view bytes);

}  // namespace varimesh::formats
