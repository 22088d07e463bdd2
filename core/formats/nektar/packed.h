// Lists of numbers as compressed files of Nektar++ have them: a zlib stream in base64. Internal to core/formats.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "core/base/io/buffered_output.h"

namespace varimesh::formats {

/// Appends a number of 64 bits, or the three coordinates of a point.
inline void append_packed(std::string& bytes, std::int64_t value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}
inline void append_packed(std::string& bytes, const double* x) {
  bytes.append(reinterpret_cast<const char*>(x), 3 * sizeof *x);
}

/// What a list consists of mostly, which tells how it is compressed.
enum class PackedValues { Integers, Coordinates };

/// Writes the list of `count` things with about `bytes_each` bytes each. fill(begin, end, bytes) appends the numbers of
/// the things from begin to end − 1. The threads of the team call it for some things at a time and compress them, so
/// the list is never in memory as a whole.
void write_packed(BufferedOutput& out, PackedValues values, std::size_t count, std::size_t bytes_each,
                  const std::function<void(std::size_t begin, std::size_t end, std::string& bytes)>& fill);

}  // namespace varimesh::formats
