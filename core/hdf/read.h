// Answers the requests that read a file.
#pragma once

#include <hdf5.h>

#include <cstdint>
#include <string>

#include "core/formats/hdf5/protocol.h"

namespace varimesh::hdf {

/// The text that lists a group. Only members of the file itself are listed as what they are: whatever leads to another
/// file is of the kind Other. Throws Refusal.
std::string list(hid_t file, const std::string& path);

/// The bytes of some rows. Throws Refusal if the rows are not there, are not of this kind, or are too many.
std::string read(hid_t file, const std::string& path, formats::hdf5::Kind kind, std::int64_t first, std::int64_t count);

/// The answer to Place. Throws Refusal.
std::string place(hid_t file, const std::string& path);

}  // namespace varimesh::hdf
