#include "client/process/temporary_folder.h"

#include <cstdlib>
#include <mutex>
#include <set>

#include "core/base/io/output_file.h"

namespace varimesh::client {
namespace {

struct Folders {
  std::mutex mutex;
  std::set<std::filesystem::path> paths;
};

// This is never destroyed, because the thread that ends the process may still need it.
Folders& folders() {
  static auto* const all = new Folders;
  return *all;
}

}  // namespace

TemporaryFolder::TemporaryFolder() {
  const std::lock_guard lock(folders().mutex);
  std::error_code error;
  std::string name = std::filesystem::temp_directory_path(error) / "varimesh-XXXXXX";
  if (error || mkdtemp(name.data()) == nullptr) return;
  path_ = name;
  folders().paths.insert(path_);
}

TemporaryFolder::~TemporaryFolder() {
  if (path_.empty()) return;
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
  const std::lock_guard lock(folders().mutex);
  folders().paths.erase(path_);
}

void remove_temporary_files() {
  OutputFile::discard_all();
  folders().mutex.lock();  // This is never unlocked, so that no new folders are made.
  // Other threads may still write. A file that appears while its folder is being removed makes the removal fail, so it
  // is repeated.
  for (const std::filesystem::path& path : folders().paths) {
    std::error_code error;
    for (int attempt = 0; attempt < 10 && std::filesystem::exists(path, error); ++attempt)
      std::filesystem::remove_all(path, error);
  }
}

}  // namespace varimesh::client
