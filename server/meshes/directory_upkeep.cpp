// Work on the directory that no call asks for: reading it at the start, compression, and sweeping.
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <vector>

#include "server/meshes/directory_mesh_store.h"
#include "server/meshes/directory_upload.h"
#include "server/meshes/zstd.h"

namespace varimesh::server {
namespace {

/// Smaller files are not compressed, since that would save almost nothing.
constexpr std::int64_t kLeastCompressed = 64 * 1024;

}  // namespace

// ===== reading =====

void DirectoryMeshStore::read_directory() {
  std::error_code ignored;
  std::vector<std::filesystem::path> compressed;
  for (const auto& file : std::filesystem::directory_iterator(directory_, ignored)) {
    const std::string name = file.path().filename().string();
    if (name == kDamagedFolder) continue;
    if (file.symlink_status(ignored).type() != std::filesystem::file_type::regular) {
      // A symbolic link could lead to any file of the system, which the store would then give to its clients.
      settings_.log("'" + file.path().string() + "' is not a file; the store ignores it.");
      continue;
    }
    if (name.rfind("part-", 0) == 0) std::filesystem::remove(file.path(), ignored);
    if (is_sha256(name)) read_entry(file.path(), name, Form::Plain);
    if (file.path().extension() == ".zst" && is_sha256(file.path().stem().string())) compressed.push_back(file.path());
  }
  // If there are both files of a mesh, the process ended after it named one and before it removed the other.
  for (const std::filesystem::path& path : compressed) read_entry(path, path.stem().string(), Form::Zstd);
  read_owners();
}

void DirectoryMeshStore::read_entry(const std::filesystem::path& path, const std::string& digest, Form form) {
  std::error_code ignored;
  Entry entry;
  entry.form = form;
  entry.stored = entry.size = static_cast<std::int64_t>(std::filesystem::file_size(path, ignored));
  if (form == Form::Zstd) {
    const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
    const auto opened = file < 0 ? nullptr : ZstdFile::open(file);
    if (opened == nullptr) return;
    entry.size = opened->size();
    std::filesystem::remove(path_of(digest, Form::Plain), ignored);
  }
  // A client that was told before the process ended that the store has a mesh has one hour to use it.
  using Age = std::filesystem::file_time_type::duration;
  const Age age = std::filesystem::file_time_type::clock::now() - std::filesystem::last_write_time(path, ignored);
  const Age oldest = std::chrono::duration_cast<Age>(settings_.lifetime - std::chrono::hours(1));
  entry.touched = settings_.clock() - std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                                          std::min(std::max(age, Age::zero()), oldest));
  entry.writing = ++writings_;
  entries_[digest] = entry;
}

// ===== compressing =====

std::string DirectoryMeshStore::next_to_compress(const std::set<std::string>& needed) {
  std::lock_guard lock(mutex_);
  const auto now = settings_.clock();
  for (const auto& [digest, entry] : entries_)
    if (entry.form == Form::Plain && !entry.stays_plain && !entry.lost && entry.size >= kLeastCompressed &&
        now - entry.touched >= settings_.compress_after && !needed.contains(digest))
      return digest;
  return {};
}

std::optional<std::int64_t> DirectoryMeshStore::stored_bytes() const {
  std::lock_guard lock(mutex_);
  std::int64_t bytes = 0;
  for (const auto& [digest, entry] : entries_) bytes += entry.stored;
  return bytes;
}

void DirectoryMeshStore::compress_idle(const std::set<std::string>& needed, const std::function<bool()>& given_up) {
  if (settings_.compress_after.count() == 0) return;
  // A mesh that becomes needed during this call has been used during it, and so is not idle before `end`.
  const auto end = settings_.clock() + settings_.compress_after;
  while (!given_up() && settings_.clock() < end) {
    const std::string digest = next_to_compress(needed);
    if (digest.empty() || !has_room() || !compress(digest, given_up)) return;
  }
}

bool DirectoryMeshStore::compress(const std::string& digest, const std::function<bool()>& given_up) {
  const std::filesystem::path path = temporary_path();
  const std::int64_t writing = [&] {
    std::lock_guard lock(mutex_);
    const auto entry = find_stored(digest);
    return entry == entries_.end() ? -1 : entry->second.writing;
  }();
  const int from = ::open(path_of(digest, Form::Plain).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
  int reason = from < 0 ? errno : 0;
  const bool is_gone = reason == ENOENT || reason == ELOOP, is_too_many = reason == EMFILE || reason == ENFILE;
  const int to = ::open(path.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0600);
  Compression outcome = Compression::Failed;
  if (from >= 0 && to >= 0) {
    outcome = compress_file(from, to, given_up);
    reason = errno;
  } else if (from < 0 && !is_too_many) {
    outcome = Compression::Unreadable;
  }
  struct stat status {};
  if (outcome == Compression::Smaller && (::fstat(to, &status) != 0 || (durable_ && ::fdatasync(to) != 0)))
    outcome = Compression::Failed;
  if (from >= 0) ::close(from);
  if (to >= 0) ::close(to);

  std::unique_lock lock(mutex_);
  auto entry = find_stored(digest);
  const bool is_there = entry != entries_.end() && entry->second.writing == writing;
  std::error_code error;
  if (outcome == Compression::Smaller && is_there) {
    std::filesystem::rename(path, path_of(digest, Form::Zstd), error);
    if (error) outcome = Compression::Failed;
  }
  if (outcome != Compression::Smaller || !is_there) {
    std::filesystem::remove(path, error);
    if (is_there && outcome == Compression::NotWorthIt) entry->second.stays_plain = true;
    if (is_there && outcome == Compression::Unreadable) {
      const std::string why = std::strerror(reason);
      entry->second.stays_plain = true;
      if (is_gone)
        lose(entry, why);
      else
        settings_.log("The stored mesh " + digest + " cannot be read (" + why + "); check the disk.");
    }
    return outcome != Compression::Failed;
  }
  entry->second.form = Form::Zstd;
  entry->second.stored = status.st_size;
  lock.unlock();
  // The plain file is removed once the compressed file is certainly on the disk, or else at the next start.
  if (durable_ && !sync_directory(directory_)) return false;
  lock.lock();
  entry = find_stored(digest);
  if (entry != entries_.end() && entry->second.form == Form::Zstd)
    std::filesystem::remove(path_of(digest, Form::Plain), error);
  return true;
}

// ===== sweeping =====

void DirectoryMeshStore::drop_old_uploads() {
  const auto now = settings_.clock();
  std::erase_if(uploads_, [&](const auto& entry) {
    std::unique_lock lock(entry.second->mutex, std::try_to_lock);
    const bool old = lock.owns_lock() && now - entry.second->touched > kUploadLifetime;
    if (old) entry.second->ended = true;
    if (lock.owns_lock()) lock.unlock();
    return old;
  });
}

void DirectoryMeshStore::sweep() {
  std::lock_guard lock(mutex_);
  drop_old_uploads();
  const auto now = settings_.clock();
  std::int64_t total = 0;
  std::vector<std::pair<std::chrono::steady_clock::time_point, Entries::iterator>> idle;
  for (auto entry = entries_.begin(); entry != entries_.end(); ++entry) {
    total += entry->second.stored;
    if (entry->second.references == 0) idle.emplace_back(entry->second.touched, entry);
  }
  std::sort(idle.begin(), idle.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [touched, entry] : idle) {
    const bool too_old = now - touched >= settings_.lifetime;
    // A client that was just told that the store has this mesh is about to refer to it.
    const bool too_much = settings_.max_total_bytes > 0 && total > settings_.max_total_bytes &&
                          now - touched > std::min<std::chrono::minutes>(kUploadLifetime, settings_.lifetime);
    if (!too_old && !too_much) continue;
    total -= entry->second.stored;
    drop(entry);
  }
}

}  // namespace varimesh::server
