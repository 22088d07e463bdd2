// Temporary folders, and the removal of everything unfinished when the process ends at once.
#pragma once

#include <filesystem>

namespace varimesh::client {

/// A new folder in the folder for temporary files. It is removed with the object, or by remove_temporary_files().
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  /// Empty if no folder could be made (errno says why).
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// Removes the temporary folders and the unfinished outputs of this process, and prevents new ones. Call it right
/// before the process ends, from any thread.
void remove_temporary_files();

}  // namespace varimesh::client
