// A file that the first rank reads and all ranks have in memory.
#pragma once

#include <string>

#include "core/base/error.h"
#include "core/ranks/ranks.h"

namespace varimesh::client {

/// What to say if the memory of a rank is too small.
inline constexpr const char* kNoRoomForMesh =
    "There is not enough memory: each rank holds the whole mesh; use fewer ranks on each machine, or machines with "
    "more memory.";

/// The bytes of the file, which the first rank reads. All call it together. Errors: BadInput, the same on all ranks.
Expected<std::string> read_everywhere(const std::string& path, const Ranks& ranks);

}  // namespace varimesh::client
