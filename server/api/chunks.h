// Pieces of meshes as they come in.
#pragma once

#include <string>
#include <string_view>

#include "server/failure.h"
#include "varimesh/v1/service.pb.h"

namespace varimesh::server {

/// The bytes that a chunk stands for: its own, or those of its frame, which `buffer` then holds. INVALID_ARGUMENT where
/// it is too large or damaged.
Answer<std::string_view> bytes_of(const v1::Chunk& chunk, std::string* buffer);

}  // namespace varimesh::server
