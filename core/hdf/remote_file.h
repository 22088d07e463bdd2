// An HDF5 file whose bytes the process at the other end of the socket has.
#pragma once

#include <hdf5.h>

#include <cstdint>

namespace varimesh::hdf {

/// Opens the file for reading. HDF5 gets its bytes over the socket when it needs them (Answer::Need in protocol.h), so
/// that there is no copy of the file. One file can be open at a time. Returns a negative number if it is no whole HDF5
/// file. Throws Refusal if HDF5 cannot be used.
/// @param bytes the size of the file
hid_t open_remote(std::int64_t bytes);

}  // namespace varimesh::hdf
