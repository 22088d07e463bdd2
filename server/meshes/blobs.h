// Opens the files of the mesh store, plain or compressed, and compares them with their digests.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "server/meshes/mesh_store.h"

namespace varimesh::server {

/// The form of a file in the store.
enum class Form { Plain, Zstd };

/// Larger meshes are copied to a file without a name, so that the system can reclaim their memory.
inline constexpr std::int64_t kMostInMemory = std::int64_t{64} << 20;

/// What a file of the store must contain.
struct Content {
  std::string digest;
  std::int64_t size = 0;  ///< In bytes, uncompressed.
};

/// Takes ownership of the descriptor and returns all bytes of the file. They are a copy, in memory or in a file without
/// a name in `directory`: nothing that happens to the file later changes them or ends the process. Null if reading or
/// writing fails (errno); EBADMSG if the file does not have this content.
std::shared_ptr<const Blob> load_file(int file, Form form, const Content& content,
                                      const std::filesystem::path& directory);
/// Takes ownership of the descriptor and reads the file once to compare it with its digest. A file that was compared in
/// the last ten minutes, and has not been changed since, is not read again. Null if that fails (errno); EBADMSG if the
/// file does not have this content.
std::unique_ptr<BlobReader> read_file(int file, Form form, const Content& content);
/// Takes ownership of the descriptor and compares the file in steps, so that read_file() need not. Null if there is
/// nothing to compare, or if the file cannot be read: read_file() says why.
std::unique_ptr<BlobCheck> check_file(int file, Form form, const Content& content);

/// Whether the file, read to its end, has the content of this digest.
bool is_whole(const std::filesystem::path& path, Form form, const std::string& digest);

}  // namespace varimesh::server
