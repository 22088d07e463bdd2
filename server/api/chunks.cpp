#include "server/api/chunks.h"

#include "server/meshes/zstd.h"
#include "server/operations/limits.h"

namespace varimesh::server {

Answer<std::string_view> bytes_of(const v1::Chunk& chunk, std::string* buffer) {
  const auto refuse = [](const char* sentence) {
    return failure(Failure::Code::InvalidArgument, "BAD_REQUEST", sentence);
  };
  if (chunk.data().size() > kMaxChunkBytes) return refuse("A chunk has more than 1 MiB; send smaller ones.");
  if (chunk.encoding() == v1::ENCODING_UNSPECIFIED) return chunk.data();
  if (chunk.encoding() != v1::ENCODING_ZSTD) return refuse("A chunk's encoding is not one that this server knows.");
  if (!zstd_decompress(chunk.data(), kMaxChunkBytes, buffer))
    return refuse("A chunk is not one whole zstd frame that says its content's size, of at most 1 MiB; send it again.");
  return *buffer;
}

}  // namespace varimesh::server
