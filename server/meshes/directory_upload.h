// An upload on its way into the directory store.
#pragma once

#include <unistd.h>

#include <mutex>

#include "server/meshes/directory_mesh_store.h"
#include "server/meshes/sha256.h"

namespace varimesh::server {

/// Brings the names of new files in a directory to the disk; false where that cannot be done (errno).
bool sync_directory(const std::filesystem::path& directory);

/// An upload under way. Its own mutex orders the streams that may follow each other; the store's is taken within it,
/// and within the store's it is only tried.
struct DirectoryMeshStore::Upload {
  ~Upload() {
    if (file >= 0) ::close(file);
    std::error_code ignored;
    if (!path.empty()) std::filesystem::remove(path, ignored);
  }
  std::mutex mutex;
  std::string digest;
  std::int64_t size = 0;
  std::int64_t committed = 0;
  std::int64_t generation = 0;
  bool ended = false;  ///< The store knows it no more.
  int file = -1;
  std::filesystem::path path;
  Sha256 hash;
  std::chrono::system_clock::time_point touched;
};

}  // namespace varimesh::server
