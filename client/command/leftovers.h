// What must not outlive the process, even where it ends at once.
#pragma once

#include <filesystem>

namespace varimesh::client {

/// A folder of its own, gone with the object, or with remove_leftovers().
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  /// Empty where none could be made (errno).
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// Removes the temporary folders and the unfinished outputs of this process, and lets no more be made. Comes right
/// before the end, from any thread.
void remove_leftovers();

}  // namespace varimesh::client
