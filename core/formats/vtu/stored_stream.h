// zlib streams whose content is stored as it is. Internal to core/formats.
// Format: RFC 1950 (zlib) and RFC 1951, section 3.2.4 (stored blocks).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string_view>

namespace varimesh::formats {

/// The checksum Adler-32 of the bytes. Several times as fast as zlib's on processors with vectors.
std::uint32_t adler32_of(std::string_view bytes);

/// The most bytes of a stored block.
inline constexpr std::size_t kMostStored = 65535;

/// The size of the stream, in bytes, for this size of its content: 2 bytes come before the blocks, 5 before each block,
/// and a checksum of 4 after them.
constexpr std::size_t stored_stream_size(std::size_t content) {
  return 2 + (content + kMostStored - 1) / kMostStored * 5 + content + 4;
}

/// Calls pass_on(piece) for the pieces of the stream with this content, in order.
void write_stored_stream(std::string_view content, const std::function<void(std::string_view)>& pass_on);

/// Fills `content` from a stream whose content has exactly this size and is all in stored blocks. Returns false if the
/// stream is damaged or of another kind, which zlib can tell; `content` may then be filled in part. Bytes after the end
/// of the stream are ignored.
bool read_stored_stream(std::string_view stream, std::span<char> content);

}  // namespace varimesh::formats
