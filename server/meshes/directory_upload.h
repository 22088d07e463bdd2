// What the files of the directory store share: uploads, and writing to the disk.
#pragma once

#include <unistd.h>

#include <mutex>

#include "core/base/sha256.h"
#include "server/meshes/directory_mesh_store.h"

namespace varimesh::server {

/// The refusal of a mesh that the disk cannot take, for the reason `why` and errno.
Refusal cannot_store(const std::string& why);

/// Writes the names of new files in a directory to the disk. Returns false if that fails (errno).
bool sync_directory(const std::filesystem::path& directory);

/// An upload that has not ended. Its mutex orders the streams that continue it one after another. The store's mutex may
/// be locked while this one is held; while the store's is held, this one is only tried.
struct DirectoryMeshStore::Upload {
  ~Upload() {
    if (file >= 0) ::close(file);
    std::error_code ignored;
    if (!path.empty()) std::filesystem::remove(path, ignored);
  }
  std::mutex mutex;
  std::string digest;
  std::int64_t size = 0;
  std::int64_t committed = 0;   ///< Bytes received so far.
  std::int64_t generation = 0;  ///< Number of the newest stream.
  bool ended = false;           ///< The store has dropped or finished it.
  int file = -1;
  std::filesystem::path path;
  Sha256 hash;
  std::chrono::system_clock::time_point touched;
};

}  // namespace varimesh::server
