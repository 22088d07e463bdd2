// Pieces of a mesh as zstd frames, for a network that is slower than compressing.
#pragma once

#include <string>
#include <string_view>

namespace varimesh::client {

/// One frame; empty where it would not be smaller by an eighth.
std::string compress(std::string_view bytes);
/// The content of one whole frame of at most `most` bytes; false where it is none or is damaged.
bool expand(std::string_view frame, std::size_t most, std::string* bytes);

}  // namespace varimesh::client
