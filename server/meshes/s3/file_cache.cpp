// Opens, takes and deletes files.
#include "server/meshes/s3/file_cache.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <system_error>

#include "core/base/sha256.h"

namespace varimesh::server {

FileCache::FileCache(std::filesystem::path directory, std::int64_t most_bytes)
    : directory_(std::move(directory)), most_bytes_(most_bytes) {
  std::error_code error;
  std::filesystem::create_directories(directory_, error);
  for (std::filesystem::directory_iterator at(directory_, error), end; !error && at != end; at.increment(error)) {
    const std::string name = at->path().filename().string();
    std::error_code ignored;
    if (name.starts_with("part-")) std::filesystem::remove(at->path(), ignored);
    if (!is_sha256(name)) continue;
    const auto size = static_cast<std::int64_t>(at->file_size(ignored));
    if (ignored) continue;
    entries_[name] = {size, 0};
    bytes_ += size;
  }
  make_room();
}

std::filesystem::path FileCache::new_path() {
  std::lock_guard lock(mutex_);
  return directory_ / ("part-" + std::to_string(++names_));
}

int FileCache::open(const std::string& digest) {
  std::lock_guard lock(mutex_);
  const auto found = entries_.find(digest);
  if (found == entries_.end()) return -1;
  found->second.used = ++uses_;
  return ::open((directory_ / digest).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
}

int FileCache::adopt(const std::filesystem::path& path, const std::string& digest, std::int64_t size) {
  std::lock_guard lock(mutex_);
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
  if (file < 0 || ::rename(path.c_str(), (directory_ / digest).c_str()) != 0) {
    if (file >= 0) ::close(file);
    return -1;
  }
  Entry& entry = entries_[digest];
  bytes_ += size - entry.size;
  entry = {size, ++uses_};
  make_room();
  return file;
}

void FileCache::drop(const std::string& digest) {
  std::lock_guard lock(mutex_);
  const auto found = entries_.find(digest);
  if (found == entries_.end()) return;
  bytes_ -= found->second.size;
  entries_.erase(found);
  ::unlink((directory_ / digest).c_str());
}

std::int64_t FileCache::bytes() const {
  std::lock_guard lock(mutex_);
  return bytes_;
}

void FileCache::make_room() {
  while (bytes_ > most_bytes_ && !entries_.empty()) {
    const auto oldest = std::ranges::min_element(entries_, {}, [](const auto& entry) { return entry.second.used; });
    bytes_ -= oldest->second.size;
    ::unlink((directory_ / oldest->first).c_str());
    entries_.erase(oldest);
  }
}

}  // namespace varimesh::server
