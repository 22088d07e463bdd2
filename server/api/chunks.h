// The chunks of a mesh that a client sends.
#pragma once

#include <string>
#include <string_view>

#include "server/failure.h"
#include "varimesh/v1/service.pb.h"

namespace varimesh::server {

/// Returns the bytes of a chunk: its data, or the content of its zstd frame, which is then stored in `buffer`.
/// Fails with INVALID_ARGUMENT if the chunk is too large or damaged.
Answer<std::string_view> bytes_of(const v1::Chunk& chunk, std::string* buffer);

}  // namespace varimesh::server
