// An upload into the directory store.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>

#include "core/base/sha256.h"
#include "server/meshes/directory_mesh_store.h"
#include "server/meshes/disk.h"

namespace varimesh::server {

/// An upload that has not ended. It holds no descriptor between its messages: a client that stays away costs nothing.
/// Its mutex orders the streams that continue it one after another. The store's mutex may be locked while this one is
/// held; while the store's mutex is held, this one is only locked if it is free.
struct DirectoryMeshStore::Upload {
  ~Upload() {
    std::error_code ignored;
    if (!path.empty()) std::filesystem::remove(path, ignored);
  }
  std::mutex mutex;
  std::string digest;
  std::int64_t size = 0;
  std::int64_t committed = 0;   ///< Bytes received so far.
  std::int64_t generation = 0;  ///< Number of the newest stream.
  bool ended = false;           ///< The store has dropped or finished it.
  std::filesystem::path path;
  std::weak_ptr<Promise> promise;  ///< Of the streams that hold tickets.
  Sha256 hash;
  std::chrono::steady_clock::time_point touched;
};

}  // namespace varimesh::server
