// Checks and decompresses chunks.
#include "server/api/chunks.h"

#include "server/limits.h"
#include "server/meshes/zstd.h"
#include "server/refusals.h"

namespace varimesh::server {

Answer<std::string_view> bytes_of(const v1::Chunk& chunk, std::string* buffer) {
  if (chunk.data().size() > kMaxChunkBytes) return bad_request("A chunk has more than 1 MiB; send smaller chunks.");
  if (chunk.encoding() == v1::ENCODING_UNSPECIFIED) return chunk.data();
  if (chunk.encoding() != v1::ENCODING_ZSTD) return bad_request("This server does not know the encoding of a chunk.");
  if (!zstd_decompress(chunk.data(), kMaxChunkBytes, buffer))
    return bad_request(
        "A chunk is not exactly one zstd frame that states the size of its content, at most 1 MiB; send it again.");
  return *buffer;
}

}  // namespace varimesh::server
