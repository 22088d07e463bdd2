// Counts what the heap of this program holds, and the most that it has held.
#pragma once

#include <cstdint>

namespace varimesh::testing {

/// Bytes that are allocated now, by operator new and by malloc() alike, with the header of each block. 0 if nothing is
/// counted: under a sanitizer, which has an allocator of its own, and without glibc.
std::int64_t bytes_in_use();

/// The most bytes that were allocated at a time since forget_peak().
std::int64_t peak_bytes();
void forget_peak();

}  // namespace varimesh::testing
