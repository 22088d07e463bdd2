// What the files of the directory store share: uploads, and writing to the disk.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>

#include "core/base/sha256.h"
#include "server/meshes/directory_mesh_store.h"

namespace varimesh::server {

/// The refusal of a mesh that the disk cannot take, for the reason `why` and errno.
Refusal cannot_store(const std::string& why);

/// Writes the names of new files in a directory to the disk. Returns false if that fails (errno).
bool sync_directory(const std::filesystem::path& directory);

/// Bytes that a client has announced and not sent yet, counted until they have come or this object is destroyed.
class Promise {
 public:
  Promise(std::atomic<std::int64_t>& all, std::int64_t bytes) : all_(&all), left_(bytes) { *all_ += left_; }
  Promise(Promise&& other) noexcept : all_(other.all_), left_(std::exchange(other.left_, 0)) {}
  ~Promise() { *all_ -= left_; }
  /// These bytes have come.
  void keep(std::int64_t bytes) {
    const std::int64_t kept = std::min(bytes, left_);
    left_ -= kept;
    *all_ -= kept;
  }

 private:
  std::atomic<std::int64_t>* all_;
  std::int64_t left_;
};

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
