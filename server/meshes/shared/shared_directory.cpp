// Objects as files. Locks and times of change take the place of tags.
#include "server/meshes/shared/shared_directory.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <random>
#include <system_error>

#include "core/base/io/write_all.h"
#include "server/meshes/read_at.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

using std::filesystem::path;

constexpr char kAbout[] = ".about";

/// The time at which a file changed, in nanoseconds since 1970.
std::int64_t time_of_change(const struct stat& status) {
  return std::int64_t{status.st_mtim.tv_sec} * 1'000'000'000 + status.st_mtim.tv_nsec;
}

Object object_of(std::string name, const struct stat& status) {
  return {std::move(name), status.st_size, std::to_string(time_of_change(status)), time_of_change(status)};
}

/// A file that no other server removes or replaces as long as this object exists.
class Held {
 public:
  Held(const path& path, int flags) : file_(::open(path.c_str(), flags | O_CLOEXEC | O_NOFOLLOW, 0600)) {
    if (file_ < 0) return;
    struct stat at_path {};
    is_locked_ = ::flock(file_, LOCK_EX) == 0 && ::fstat(file_, &status_) == 0 && S_ISREG(status_.st_mode);
    is_there_ = is_locked_ && ::lstat(path.c_str(), &at_path) == 0 && at_path.st_ino == status_.st_ino;
  }
  explicit Held(const path& path) : Held(path, O_RDWR | O_NONBLOCK) {}
  ~Held() {
    if (file_ >= 0) ::close(file_);
  }
  Held(const Held&) = delete;
  Held& operator=(const Held&) = delete;
  int file() const { return file_; }
  bool is_locked() const { return is_locked_; }
  /// Whether the file had its name when it was locked.
  bool is_there() const { return is_there_; }
  const struct stat& status() const { return status_; }

 private:
  const int file_;
  struct stat status_ {};
  bool is_locked_ = false, is_there_ = false;
};

class SharedDirectory : public ObjectStore {
 public:
  SharedDirectory(path directory, path scratch) : directory_(std::move(directory)), scratch_(std::move(scratch)) {}
  ~SharedDirectory() override {
    if (sweeper_ >= 0) ::close(sweeper_);
  }

  const path& scratch() const override { return scratch_; }
  const path& directory() const override { return directory_; }
  path new_path() override {
    // Servers share the directory, so that a count would not do.
    std::random_device device;
    return directory_ / ("part-" + std::to_string(device()) + "-" + std::to_string(device()));
  }

  Answer<std::string> put_file(const std::string& digest, const path& part, std::int64_t, Patience) override;
  Answer<void> put(const std::string& name, std::string_view bytes, Patience) override;
  Answer<std::optional<Object>> find(const std::string& name, Patience) override;
  Answer<std::optional<Object>> use(const std::string& digest, Patience patience) override;
  Answer<OpenObject> get(const std::string& digest, bool again, Patience patience) override;
  Answer<std::vector<Object>> list(const std::string& beginning, Patience) override;
  Answer<void> remove(const std::string& name, Patience) override;
  Answer<bool> remove_unused(const std::string& digest, const std::string& tag,
                             const std::function<Answer<bool>()>& may_go, Patience) override;
  bool set_aside(const std::string& digest, const std::string& version) override;

  std::shared_ptr<const void> hold(const std::string& key, bool make) override;
  Answer<UploadState> upload_state(const std::string& key, Patience) override;
  std::optional<path> upload_file(const std::string& key) const override { return directory_ / key; }
  Answer<void> put_part(const std::string&, std::int64_t, std::string_view, Patience) override { return {}; }
  Answer<void> get_parts(const std::string&, std::int64_t, int, Patience) override { return {}; }
  Answer<void> remove_upload(const std::string& key, Patience patience) override {
    if (const auto removed = remove(key, patience); !removed) return removed;
    return remove(key + kAbout, patience);
  }

  bool may_sweep(std::chrono::steady_clock::time_point) override {
    if (sweeper_ < 0)
      sweeper_ = ::open((directory_ / "sweeper").c_str(), O_CREAT | O_RDWR | O_CLOEXEC | O_NOFOLLOW, 0600);
    return sweeper_ >= 0 && ::flock(sweeper_, LOCK_EX | LOCK_NB) == 0;
  }

 private:
  const path directory_, scratch_;
  int sweeper_ = -1;  ///< The descriptor of the file `sweeper`.
};

// ===== writing =====

Answer<std::string> SharedDirectory::put_file(const std::string& digest, const path& part, std::int64_t, Patience) {
  const int file = ::open(part.c_str(), O_WRONLY | O_CLOEXEC | O_NOFOLLOW);
  struct stat status {};
  const bool written =
      file >= 0 && ::futimens(file, nullptr) == 0 && ::fdatasync(file) == 0 && ::fstat(file, &status) == 0;
  const int reason = errno;
  if (file >= 0) ::close(file);
  errno = reason;
  if (!written) return cannot_store("a file cannot be written to the disk");
  {
    // The new file replaces one that may have been damaged since it was stored.
    const Held before(directory_ / digest);
    if (::rename(part.c_str(), (directory_ / digest).c_str()) != 0)
      return cannot_store("a finished file cannot be renamed");
  }
  if (!sync_directory(directory_)) return cannot_store("a directory cannot be written to the disk");
  return object_of(digest, status).tag;
}

Answer<void> SharedDirectory::put(const std::string& name, std::string_view bytes, Patience) {
  const path file_path = directory_ / name;
  int file = ::open(file_path.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0600);
  const bool is_new = file >= 0;
  if (!is_new && errno == EEXIST) file = ::open(file_path.c_str(), O_WRONLY | O_CLOEXEC | O_NOFOLLOW);
  if (file < 0) return cannot_store("a file cannot be created");
  // In place, since the file of an upload is locked.
  const bool written = bytes.empty() || (::ftruncate(file, 0) == 0 && write_all(file, bytes));
  const int reason = errno;
  ::close(file);
  errno = reason;
  if (!written) return cannot_store("a file cannot be written");
  if (is_new && bytes.empty() && !sync_directory(directory_))
    return cannot_store("a directory cannot be written to the disk");
  return {};
}

// ===== reading =====

Answer<std::optional<Object>> SharedDirectory::find(const std::string& name, Patience) {
  struct stat status {};
  if (::lstat((directory_ / name).c_str(), &status) == 0)
    return S_ISREG(status.st_mode) ? std::optional(object_of(name, status)) : std::nullopt;
  if (errno == ENOENT) return std::optional<Object>();
  return internal_failure("The directory of meshes cannot be read (" + std::string(std::strerror(errno)) +
                          "); try again.");
}

Answer<std::optional<Object>> SharedDirectory::use(const std::string& digest, Patience) {
  const Held held(directory_ / digest);
  struct stat status {};
  // The time is that of the file system's clock.
  if (!held.is_there() || ::futimens(held.file(), nullptr) != 0 || ::fstat(held.file(), &status) != 0)
    return std::optional<Object>();
  return std::optional(object_of(digest, status));
}

Answer<OpenObject> SharedDirectory::get(const std::string& digest, bool, Patience patience) {
  OpenObject opened;
  opened.file = ::open((directory_ / digest).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (opened.file < 0 && errno != ENOENT && errno != ELOOP)
    return internal_failure("The mesh " + digest + " cannot be read from the store (" + std::strerror(errno) +
                            "); try again.");
  struct stat status {};
  if (opened.file < 0 || ::fstat(opened.file, &status) != 0 || !S_ISREG(status.st_mode)) {
    if (opened.file >= 0) ::close(opened.file);
    return mesh_not_found(digest);
  }
  [[maybe_unused]] const auto used = use(digest, patience);
  opened.size = status.st_size;
  opened.version = std::to_string(status.st_ino);
  return opened;
}

Answer<std::vector<Object>> SharedDirectory::list(const std::string& beginning, Patience) {
  std::vector<Object> objects;
  std::error_code error;
  for (std::filesystem::directory_iterator at(directory_, error), end; !error && at != end; at.increment(error)) {
    std::string name = at->path().filename().string();
    const std::string stem = name.substr(0, name.find('.')), ending = name.substr(stem.size());
    const bool is_mesh = is_sha256(stem) && (ending.empty() || ending == ".kept" || is_sha256(ending.substr(1)));
    const bool is_ours = is_mesh || name.starts_with("upload-") || name.starts_with("part-");
    struct stat status {};
    if (!is_ours || !name.starts_with(beginning) || ::lstat(at->path().c_str(), &status) != 0) continue;
    if (S_ISREG(status.st_mode)) objects.push_back(object_of(std::move(name), status));
  }
  if (error) return internal_failure("The directory of meshes cannot be read (" + error.message() + "); try again.");
  return objects;
}

// ===== removing =====

Answer<void> SharedDirectory::remove(const std::string& name, Patience) {
  if (::unlink((directory_ / name).c_str()) == 0 || errno == ENOENT) return {};
  return internal_failure("A file of the directory of meshes cannot be removed (" + std::string(std::strerror(errno)) +
                          ").");
}

Answer<bool> SharedDirectory::remove_unused(const std::string& digest, const std::string& tag,
                                            const std::function<Answer<bool>()>& may_go, Patience) {
  if (const auto asked = may_go(); !asked || !*asked) return asked;
  const Held held(directory_ / digest);
  if (!held.is_there() || object_of(digest, held.status()).tag != tag) return false;
  ::unlink(
      (directory_ / (digest + ".kept")).c_str());  // first, so that it is not the pin of a mesh that is stored next
  return ::unlink((directory_ / digest).c_str()) == 0;
}

bool SharedDirectory::set_aside(const std::string& digest, const std::string& version) {
  const Held held(directory_ / digest);
  // Another server may have stored the mesh anew meanwhile.
  if (!held.is_there() || std::to_string(held.status().st_ino) != version) return false;
  return move_to_damaged(directory_, digest);
}

// ===== uploads =====

std::shared_ptr<const void> SharedDirectory::hold(const std::string& key, bool make) {
  const path about = directory_ / (key + kAbout);
  while (true) {
    auto held = std::make_shared<const Held>(about, (make ? O_CREAT : 0) | O_RDWR);
    if (!held->is_locked()) return nullptr;
    if (held->is_there()) return held;
    // The upload has ended while this stream waited.
  }
}

Answer<UploadState> SharedDirectory::upload_state(const std::string& key, Patience) {
  UploadState state;
  const int file = ::open((directory_ / (key + kAbout)).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
  const bool is_read = file >= 0 && read_at(file, 0, 256, &state.about);
  if (file >= 0) ::close(file);
  struct stat status {};
  // A server that ended while it wrote has left a part of the line. Then the upload begins again.
  if (!is_read || !state.about.ends_with('\n')) state.about.clear();
  if (!state.about.empty() && ::lstat((directory_ / key).c_str(), &status) == 0) state.committed = status.st_size;
  return state;
}

}  // namespace

Answer<std::unique_ptr<SharedMeshStore>> open_shared_directory(const std::string& directory, const std::string& scratch,
                                                               DirectoryMeshSettings settings, AskNeeded needed) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error || ::access(directory.c_str(), R_OK | W_OK | X_OK) != 0)
    return directory_unusable("Cannot keep meshes in '" + directory + "' (" +
                              (error ? error.message() : std::strerror(errno)) +
                              "); choose another directory (--meshes).");
  for (std::filesystem::directory_iterator at(directory, error), end; !error && at != end; at.increment(error))
    if (const auto ending = at->path().extension(); ending == ".zst" || ending == ".owners")
      return directory_unusable("The directory '" + directory +
                                "' has meshes in the form of a server that does not share them (*" + ending.string() +
                                "); choose another directory (--meshes).");
  return std::make_unique<SharedMeshStore>(std::make_unique<SharedDirectory>(directory, scratch),
                                           SharedMeshSettings{std::move(settings)}, std::move(needed));
}

}  // namespace varimesh::server
