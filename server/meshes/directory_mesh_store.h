// Meshes in a directory of their own, one file a digest; the directory goes with the store.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "server/meshes/mesh_store.h"

namespace varimesh::server {

/// Keeps the bytes in files, so that a mesh that nobody works on costs no memory, and maps them where they are read.
class DirectoryMeshStore : public MeshStore {
 public:
  using Clock = std::function<std::chrono::steady_clock::time_point()>;

  /// Makes a directory under `parent` (empty: the system's for temporary files). Uploads of more than `max_mesh_bytes`
  /// are refused; those nobody touched for ten minutes by `clock` are dropped.
  static Answer<std::unique_ptr<DirectoryMeshStore>> create(const std::string& parent, std::int64_t max_mesh_bytes,
                                                            Clock clock = std::chrono::steady_clock::now);
  ~DirectoryMeshStore() override;

  Answer<UploadTicket> begin_upload(const std::string& id, const std::string& digest, std::int64_t size) override;
  Answer<std::int64_t> append(const UploadTicket& ticket, std::int64_t offset, std::string_view bytes) override;
  Answer<StoredBytes> finish_upload(const UploadTicket& ticket) override;
  Answer<UploadProgress> query_upload(const std::string& id, const std::string& digest) override;
  Answer<std::unique_ptr<BlobWriter>> create() override;
  Answer<std::shared_ptr<const Blob>> open(const std::string& digest) override;
  bool pin(const std::string& digest) override;
  void release(const std::string& digest) override;

 private:
  class Writer;
  struct Upload;
  struct Entry {
    std::int64_t size = 0;
    int references = 0;
    bool pinned = false;
  };

  DirectoryMeshStore(std::filesystem::path directory, std::int64_t max_mesh_bytes, Clock clock);
  std::filesystem::path path_of(const std::string& digest) const { return directory_ / digest; }
  std::filesystem::path temporary_path();
  Answer<std::shared_ptr<Upload>> find(const UploadTicket& ticket);
  /// Renames a finished file to its digest, or drops it where the digest is there already.
  Answer<StoredBytes> adopt(const std::filesystem::path& file, StoredBytes stored, bool pinned);
  void drop_old_uploads();

  const std::filesystem::path directory_;
  const std::int64_t max_mesh_bytes_;
  const Clock clock_;
  std::mutex mutex_;  ///< Guards everything below; never held while bytes are written or hashed.
  std::map<std::string, Entry> entries_;
  std::map<std::string, std::shared_ptr<Upload>> uploads_;
  std::int64_t counter_ = 0;
};

}  // namespace varimesh::server
