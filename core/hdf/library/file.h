// Reads HDF5 files.
#pragma once

#include <memory>
#include <span>

#include "core/hdf/content/source.h"

namespace varimesh::hdf {

/// Opens the file that these bytes are, and never closes it: the process is to end with _exit(). The bytes must stay
/// where they are; nothing changes them. Only members of the
/// file itself are listed as what they are: whatever leads to another file is of the kind Other. Throws Refusal, as the
/// functions of the object do.
std::unique_ptr<formats::Hdf5Source> open_file(std::span<char> bytes);

}  // namespace varimesh::hdf
