// The directory in which a server keeps what outlives it: one server at a time.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "core/base/error.h"

namespace varimesh::server {

/// Holds the directory for this process, until it ends in whatever way.
class StateDirectory {
 public:
  /// Makes the directory, for its owner alone, where it is not there. Errors: Output where that cannot be done, or
  /// where another server has it.
  static Expected<std::unique_ptr<StateDirectory>> take(const std::string& given);
  ~StateDirectory();
  StateDirectory(const StateDirectory&) = delete;
  StateDirectory& operator=(const StateDirectory&) = delete;

  std::string jobs() const { return (path_ / "jobs.sqlite").string(); }
  std::string meshes() const { return (path_ / "meshes").string(); }

 private:
  StateDirectory(std::filesystem::path path, int lock) : path_(std::move(path)), lock_(lock) {}

  const std::filesystem::path path_;
  const int lock_;
};

}  // namespace varimesh::server
