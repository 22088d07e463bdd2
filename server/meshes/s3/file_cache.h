// Copies of meshes on this server's disk, as many as there is room for.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>

namespace varimesh::server {

/// Files named by digest in a directory that only this server uses. The ones that were used least lately are deleted
/// when all of them together have too many bytes. A file that is open stays readable until it is closed. Thread-safe.
class FileCache {
 public:
  /// Keeps the files that an earlier server has left in the directory, and deletes what it did not finish.
  FileCache(std::filesystem::path directory, std::int64_t most_bytes);

  const std::filesystem::path& directory() const { return directory_; }
  /// A path for a new file, which nobody else uses.
  std::filesystem::path new_path();
  /// Opens the copy of a mesh for reading and returns its descriptor. −1 if there is none.
  int open(const std::string& digest);
  /// Takes a file that is whole, and opens it. −1, with errno, if that fails.
  int adopt(const std::filesystem::path& path, const std::string& digest, std::int64_t size);
  /// Deletes the copy of a mesh.
  void drop(const std::string& digest);
  std::int64_t bytes() const;

 private:
  struct Entry {
    std::int64_t size = 0, used = 0;  ///< Bytes, and when it was used: larger is later.
  };
  /// Requires the lock. Deletes until there is room again.
  void make_room();

  const std::filesystem::path directory_;
  const std::int64_t most_bytes_;
  mutable std::mutex mutex_;  ///< Guards everything below.
  std::map<std::string, Entry> entries_;
  std::int64_t bytes_ = 0, uses_ = 0, names_ = 0;
};

}  // namespace varimesh::server
