// Pieces of a mesh as zstd frames, for networks that are slower than the compression.
#pragma once

#include <string>
#include <string_view>

namespace varimesh::client {

/// Compresses `bytes` to one frame. Returns an empty string if the frame would not be smaller by at least an eighth.
std::string compress_frame(std::string_view bytes);
/// Expands one whole frame to at most `most` bytes. Returns false if `frame` is not a frame, is damaged or holds more.
bool expand_frame(std::string_view frame, std::size_t most, std::string* bytes);

}  // namespace varimesh::client
