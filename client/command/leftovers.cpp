// A list of folders under a lock.
#include "client/command/leftovers.h"

#include <cstdlib>
#include <mutex>
#include <set>

#include "core/formats/output_file.h"

namespace varimesh::client {
namespace {

struct Folders {
  std::mutex mutex;
  std::set<std::filesystem::path> paths;
};

// Never destroyed: the thread that ends the process may still need it.
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

void remove_leftovers() {
  formats::OutputFile::discard_all();
  folders().mutex.lock();  // and never unlocked: no more are made
  // Other threads still write: a file that is made while its folder goes makes the removal fail, and worth another go.
  for (const std::filesystem::path& path : folders().paths) {
    std::error_code error;
    for (int attempt = 0; attempt < 10 && std::filesystem::exists(path, error); ++attempt)
      std::filesystem::remove_all(path, error);
  }
}

}  // namespace varimesh::client
