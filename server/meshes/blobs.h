// Opens the files of the mesh store, plain or compressed, as mapped memory or as readers.
#pragma once

#include <filesystem>
#include <memory>

#include "server/meshes/mesh_store.h"

namespace varimesh::server {

/// The form of a file in the store.
enum class Form { Plain, Zstd };

/// Maps a plain file. The caller keeps the descriptor. Null if that fails (errno).
std::shared_ptr<const Blob> map_file(int file, std::size_t size);
/// Takes ownership of the descriptor of a compressed file, writes the content to a file without a name in `directory`,
/// and maps that file, so the system can reclaim the memory. Null if reading or writing fails (errno).
std::shared_ptr<const Blob> expand_file(int file, const std::filesystem::path& directory);
/// Takes ownership of the descriptor. Null if the file is damaged.
std::unique_ptr<BlobReader> read_file(int file, Form form);

}  // namespace varimesh::server
