// The directory in which a server keeps everything that outlives it. One server at a time uses it.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "core/base/error.h"

namespace varimesh::server {

/// Holds the lock of the directory until it is destroyed or the process ends for whatever reason.
class StateDirectory {
 public:
  /// Creates the directory, accessible only to its owner, if it does not exist, and locks it. Errors: Output if that is
  /// not possible, if the directory belongs to another user or others can write into it, or if another server holds the
  /// lock.
  static Expected<std::unique_ptr<StateDirectory>> take(const std::string& given);
  ~StateDirectory();
  StateDirectory(const StateDirectory&) = delete;
  StateDirectory& operator=(const StateDirectory&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// The path of the jobs' database.
  std::string jobs() const { return (path_ / "jobs.sqlite").string(); }
  /// The path of the directory of meshes.
  std::string meshes() const { return (path_ / "meshes").string(); }
  /// A file with this name says that the directory is a backup, which the next backup may replace.
  static constexpr const char* kBackupMark = "backup-of-varimesh";
  /// Removes that file: a server that uses the directory has jobs of its own there.
  void become_server() const;

 private:
  StateDirectory(std::filesystem::path path, int lock, int folder)
      : path_(std::move(path)), lock_(lock), folder_(folder) {}

  const std::filesystem::path path_;
  const int lock_, folder_;  ///< Locked: the file `lock`, and the directory itself.
};

/// Returns 16 random bytes.
std::string random_bytes();
/// Returns 16 random bytes that are kept in a directory, in the file "secret", for all servers that use it. If they
/// cannot be kept, others are returned the next time.
std::string secret_in(const std::filesystem::path& directory);

}  // namespace varimesh::server
