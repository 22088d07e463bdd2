// The socket over which the program gets requests and gives answers.
#pragma once

#include <cstddef>

namespace varimesh::hdf {

/// Reads exactly this number of bytes. Returns false if the other side is gone.
bool receive(void* to, std::size_t bytes);

/// Writes all bytes. Returns false if the other side is gone.
bool send(const void* from, std::size_t bytes);

}  // namespace varimesh::hdf
