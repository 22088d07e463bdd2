// Stored bytes in files, plain or compressed, as those who work on them and those who send them want them.
#pragma once

#include <filesystem>
#include <memory>

#include "server/meshes/mesh_store.h"

namespace varimesh::server {

/// What a file of the store holds.
enum class Form { Plain, Zstd };

/// Maps a plain file, whose descriptor stays the caller's. Null where that is not possible (errno).
std::shared_ptr<const Blob> map_file(int file, std::size_t size);
/// Writes the content of a compressed file, whose descriptor it takes over, to a file without a name in `directory`,
/// and maps that, so that the memory can be taken for others. Null where it cannot be read or written (errno).
std::shared_ptr<const Blob> expand_file(int file, const std::filesystem::path& directory);
/// Takes the descriptor over. Null where the file is damaged.
std::unique_ptr<BlobReader> read_file(int file, Form form);

}  // namespace varimesh::server
