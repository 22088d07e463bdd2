// The stored meshes. Uploads are in shared_uploads.cpp, sweeping is in shared_sweep.cpp.
#include "server/meshes/shared_mesh_store.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <random>
#include <system_error>

#include "server/meshes/blobs.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

/// A file of the store that no other server removes or replaces as long as this object exists.
class Held {
 public:
  explicit Held(const std::filesystem::path& path)
      : file_(::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK)) {
    if (file_ < 0) return;
    struct stat at_path {};
    is_there_ = ::flock(file_, LOCK_EX) == 0 && ::fstat(file_, &status_) == 0 && S_ISREG(status_.st_mode) &&
                ::lstat(path.c_str(), &at_path) == 0 && at_path.st_ino == status_.st_ino;
  }
  ~Held() {
    if (file_ >= 0) ::close(file_);
  }
  Held(const Held&) = delete;
  Held& operator=(const Held&) = delete;
  /// Whether the file had its name when it was locked.
  bool is_there() const { return is_there_; }
  const struct stat& status() const { return status_; }
  /// Sets the time of the last use to now, on the clock of the file system.
  bool note_use() const { return ::futimens(file_, nullptr) == 0; }

 private:
  const int file_;
  struct stat status_ {};
  bool is_there_ = false;
};

bool make_empty(const std::filesystem::path& path) {
  const int file = ::open(path.c_str(), O_CREAT | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (file >= 0) ::close(file);
  return file >= 0;
}

}  // namespace

Answer<std::unique_ptr<SharedMeshStore>> SharedMeshStore::open_directory(const std::string& directory,
                                                                         const std::string& scratch,
                                                                         DirectoryMeshSettings settings,
                                                                         AskNeeded needed) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error || ::access(directory.c_str(), R_OK | W_OK | X_OK) != 0)
    return directory_unusable("Cannot keep meshes in '" + directory + "' (" +
                              (error ? error.message() : std::strerror(errno)) +
                              "); choose another directory (--meshes).");
  for (std::filesystem::directory_iterator at(directory, error), end; !error && at != end; at.increment(error))
    if (const auto ending = at->path().extension(); ending == ".zst" || ending == ".owners")
      return directory_unusable("The directory '" + directory +
                                "' has meshes in the form of a server that shares them with none (*" + ending.string() +
                                "); choose another directory (--meshes).");
  return std::unique_ptr<SharedMeshStore>(
      new SharedMeshStore(directory, scratch, std::move(settings), std::move(needed)));
}

bool SharedMeshStore::has_room(std::int64_t bytes) const {
  return disk_has_room(directory_, settings_.reserve_bytes, bytes);
}

std::filesystem::path SharedMeshStore::part_path() {
  // Servers share the directory, so that a count would not do.
  std::random_device device;
  return directory_ / ("part-" + std::to_string(device()) + "-" + std::to_string(device()));
}

// ===== writing =====

Answer<std::unique_ptr<BlobWriter>> SharedMeshStore::create(std::optional<std::int64_t> announced) {
  return start_part(
      part_path(), announced, promised_, [this](std::int64_t bytes) { return has_room(bytes); },
      [this](const std::filesystem::path& part, int file, StoredBytes stored) {
        return adopt(part, file, std::move(stored), false);
      });
}

Answer<StoredBytes> SharedMeshStore::adopt(const std::filesystem::path& path, int file, StoredBytes stored,
                                           bool pinned) {
  if (::futimens(file, nullptr) != 0 || ::fdatasync(file) != 0)
    return cannot_store("a file cannot be written to the disk");
  {
    // The new file replaces one that may have been damaged since it was stored.
    const Held before(path_of(stored.digest));
    std::error_code error;
    std::filesystem::rename(path, path_of(stored.digest), error);
    if (error) {
      errno = error.value();
      return cannot_store("a finished file cannot be renamed");
    }
  }
  if (pinned && !make_empty(kept_of(stored.digest))) return cannot_store("a file cannot be created");
  if (!sync_directory(directory_)) return cannot_store("a directory cannot be written to the disk");
  if (!pinned) {
    std::lock_guard lock(mutex_);
    fresh_[stored.digest] = settings_.clock();
  }
  return stored;
}

void SharedMeshStore::release(const std::string& digest) {
  struct stat status {};
  const bool is_there = is_sha256(digest) && ::lstat(path_of(digest).c_str(), &status) == 0;
  std::lock_guard lock(mutex_);
  fresh_.erase(digest);
  if (is_there) released_[digest] = {settings_.clock(), time_of_change(status)};
}

// ===== reading =====

Answer<SharedMeshStore::Opened> SharedMeshStore::open_file(const std::string& digest) {
  if (!is_sha256(digest)) return mesh_not_found(digest);
  Opened opened;
  opened.file = ::open(path_of(digest).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
  if (opened.file < 0) return errno == ENOENT || errno == ELOOP ? mesh_not_found(digest) : cannot_read(digest, 0);
  struct stat status {};
  if (::fstat(opened.file, &status) != 0 || !S_ISREG(status.st_mode)) {
    ::close(opened.file);
    return mesh_not_found(digest);
  }
  touch(digest);
  opened.size = status.st_size;
  opened.inode = status.st_ino;
  return opened;
}

Answer<std::shared_ptr<const Blob>> SharedMeshStore::open(const std::string& digest) {
  const auto opened = open_file(digest);
  if (!opened) return tl::unexpected(opened.error());
  auto blob = load_file(opened->file, Form::Plain, {digest, opened->size}, scratch_);
  if (blob != nullptr) return blob;
  if (errno == ENOSPC || errno == EDQUOT) return store_full("The server's disk has no room to open the mesh " + digest);
  return cannot_read(digest, opened->inode);
}

Answer<std::unique_ptr<BlobReader>> SharedMeshStore::read(const std::string& digest) {
  const auto opened = open_file(digest);
  if (!opened) return tl::unexpected(opened.error());
  auto reader = read_file(opened->file, Form::Plain, {digest, opened->size});
  if (reader == nullptr) return cannot_read(digest, opened->inode);
  return reader;
}

Answer<std::int64_t> SharedMeshStore::size_of(const std::string& digest) {
  struct stat status {};
  if (!is_sha256(digest) || ::lstat(path_of(digest).c_str(), &status) != 0 || !S_ISREG(status.st_mode))
    return mesh_not_found(digest);
  return status.st_size;
}

Refusal SharedMeshStore::cannot_read(const std::string& digest, ino_t inode) {
  const int reason = errno;
  const std::string why = reason == EBADMSG ? "its bytes have changed" : std::strerror(reason);
  // Another server may have stored the mesh anew meanwhile. Other reasons, such as a network that is cut, pass.
  const bool gone =
      reason == EBADMSG && remove_file(digest, [inode](const struct stat& status) { return status.st_ino == inode; });
  if (!gone) return internal_failure("The mesh " + digest + " cannot be read from the store (" + why + "); try again.");
  settings_.log("The stored mesh " + digest + " is damaged (" + why +
                ") and was removed; the next upload with this digest is taken. Check the disk.");
  return data_lost("The stored mesh " + digest + " is damaged (" + why +
                   ") and was removed from the store; upload it, or run the job again.");
}

// ===== use, owners and removal =====

bool SharedMeshStore::touch(const std::string& digest) {
  if (!is_sha256(digest)) return false;
  const Held held(path_of(digest));
  return held.is_there() && held.note_use();
}

bool SharedMeshStore::pin(const std::string& digest) { return pin_and_measure(digest, "").has_value(); }

std::optional<std::int64_t> SharedMeshStore::pin_and_measure(const std::string& digest, const std::string& owner) {
  if (!belongs_to(digest, owner) || !make_empty(kept_of(digest)) || !touch(digest)) return std::nullopt;
  const auto size = size_of(digest);
  return size ? std::optional(*size) : std::nullopt;
}

bool SharedMeshStore::belongs_to(const std::string& digest, const std::string& owner) {
  if (!size_of(digest)) return false;
  return owner.empty() || ::access(mark_path(digest, owner).c_str(), F_OK) == 0;
}

void SharedMeshStore::grant(const std::string& digest, const std::string& owner) {
  if (size_of(digest) && !belongs_to(digest, owner) && !mark(digest, owner))
    settings_.log("The owner of the mesh " + digest + " cannot be noted: " + std::strerror(errno));
}

bool SharedMeshStore::mark(const std::string& digest, const std::string& owner) {
  return owner.empty() || (make_empty(mark_path(digest, owner)) && sync_directory(directory_));
}

bool SharedMeshStore::has_owners(const std::string& digest) const {
  std::error_code error;
  for (std::filesystem::directory_iterator at(directory_, error), end; !error && at != end; at.increment(error)) {
    const std::string name = at->path().filename().string();
    if (name.size() == 2 * digest.size() + 1 && name.starts_with(digest + ".")) return true;
  }
  return bool(error);  // nobody's mesh is deleted because a directory cannot be read
}

Answer<void> SharedMeshStore::remove(const std::string& digest, const std::string& owner) {
  if (!belongs_to(digest, owner)) return mesh_not_found(digest);
  // Whoever stores or uses the mesh from now on changes its time.
  struct stat before {};
  if (::lstat(path_of(digest).c_str(), &before) != 0) return {};
  const auto needed = needed_({digest});
  if (!needed) return tl::unexpected(needed.error());
  if (owner.empty() && !needed->empty()) return mesh_in_use(digest);
  if (!owner.empty()) {
    ::unlink(mark_path(digest, owner).c_str());
    if (!needed->empty() || has_owners(digest)) return {};
  }
  const auto again = needed_({digest});
  if (!again) return tl::unexpected(again.error());
  const bool removed = again->empty() && remove_file(digest, [&](const struct stat& status) {
                         return time_of_change(status) == time_of_change(before);
                       });
  if (!removed && owner.empty()) return mesh_in_use(digest);
  return {};
}

bool SharedMeshStore::remove_file(const std::string& digest, const std::function<bool(const struct stat&)>& may_go) {
  const Held held(path_of(digest));
  if (!held.is_there() || !may_go(held.status())) return false;
  ::unlink(kept_of(digest).c_str());  // first, so that it is not the pin of a mesh that is stored next
  return ::unlink(path_of(digest).c_str()) == 0;
}

}  // namespace varimesh::server
