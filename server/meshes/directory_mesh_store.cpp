// The stored meshes. Uploads are in directory_uploads.cpp; compression and sweeping are in directory_upkeep.cpp.
#include "server/meshes/directory_mesh_store.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>
#include <tuple>

#include "core/base/sha256.h"
#include "core/base/write_all.h"
#include "server/meshes/directory_upload.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

/// The refusal of a mesh that is in the store but cannot be read (errno).
Refusal unreadable(const std::string& digest) {
  return internal_failure("The mesh " + digest + " cannot be read from the store (" + std::strerror(errno) + ").");
}

}  // namespace

Refusal cannot_store(const std::string& why) {
  return store_full("The server cannot store the mesh: " + why + " (" + std::strerror(errno) + ")");
}
/// Writes a result to a temporary file and hashes it.
class DirectoryMeshStore::Writer : public BlobWriter {
 public:
  Writer(DirectoryMeshStore* store, int file, std::filesystem::path path)
      : store_(store), file_(file), path_(std::move(path)) {}
  ~Writer() override {
    ::close(file_);
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
  bool append(std::string_view bytes) override {
    hash_.update(bytes);
    size_ += static_cast<std::int64_t>(bytes.size());
    return write_all(file_, bytes);
  }
  Answer<StoredBytes> commit() override { return store_->adopt(path_, file_, {hash_.finish(), size_}, false); }

 private:
  DirectoryMeshStore* store_;
  int file_;
  std::filesystem::path path_;
  Sha256 hash_;
  std::int64_t size_ = 0;
};

// ===== the directory =====

Answer<std::unique_ptr<DirectoryMeshStore>> DirectoryMeshStore::create(const std::string& parent,
                                                                       DirectoryMeshSettings settings) {
  std::error_code error;
  const std::filesystem::path base =
      parent.empty() ? std::filesystem::temp_directory_path(error) : std::filesystem::path(parent);
  std::string name = (base / "varimesh-XXXXXX").string();
  if (error || ::mkdtemp(name.data()) == nullptr)
    return directory_unusable("Cannot create a directory for meshes in '" + base.string() + "' (" +
                              std::strerror(errno) + "); choose another one (TMPDIR, or --data of the server).");
  return std::unique_ptr<DirectoryMeshStore>(new DirectoryMeshStore(name, std::move(settings), false));
}

Answer<std::unique_ptr<DirectoryMeshStore>> DirectoryMeshStore::open_directory(const std::string& directory,
                                                                               DirectoryMeshSettings settings) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error || ::access(directory.c_str(), R_OK | W_OK | X_OK) != 0)
    return directory_unusable("Cannot keep meshes in '" + directory + "' (" +
                              (error ? error.message() : std::strerror(errno)) +
                              "); choose another directory (--state).");
  std::unique_ptr<DirectoryMeshStore> store(new DirectoryMeshStore(directory, std::move(settings), true));
  store->read_directory();
  return store;
}

DirectoryMeshStore::DirectoryMeshStore(std::filesystem::path directory, DirectoryMeshSettings settings, bool durable)
    : directory_(std::move(directory)), settings_(std::move(settings)), durable_(durable) {}

DirectoryMeshStore::~DirectoryMeshStore() {
  uploads_.clear();
  std::error_code ignored;
  if (!durable_) std::filesystem::remove_all(directory_, ignored);
}

std::filesystem::path DirectoryMeshStore::temporary_path() {
  std::lock_guard lock(mutex_);
  return directory_ / ("part-" + std::to_string(++counter_));
}

bool DirectoryMeshStore::has_room(std::int64_t bytes) const {
  std::error_code error;
  const auto space = std::filesystem::space(directory_, error);
  return error || static_cast<std::int64_t>(space.available) >= settings_.reserve_bytes + bytes;
}

// ===== stored bytes =====

Answer<StoredBytes> DirectoryMeshStore::adopt(const std::filesystem::path& path, int file, StoredBytes stored,
                                              bool pinned) {
  if (durable_ && ::fdatasync(file) != 0) return cannot_store("a file cannot be written to the disk");
  bool is_new = false;
  {
    std::lock_guard lock(mutex_);
    Entries::iterator found;
    std::tie(found, is_new) = entries_.try_emplace(stored.digest);
    Entry& entry = found->second;
    if (is_new) {
      std::error_code error;
      std::filesystem::rename(path, path_of(stored.digest, Form::Plain), error);
      if (error) {
        entries_.erase(found);
        errno = error.value();
        return cannot_store("a finished file cannot be renamed");
      }
      entry.size = entry.stored = stored.size;
    }
    entry.touched = settings_.clock();
    if (pinned)
      entry.pinned = true;
    else
      ++entry.references;
  }
  if (durable_ && !sync_directory(directory_)) {
    const int reason = errno;
    take_back(stored.digest, pinned, is_new);
    errno = reason;
    return cannot_store("a directory cannot be written to the disk");
  }
  return stored;
}

void DirectoryMeshStore::take_back(const std::string& digest, bool pinned, bool is_new) {
  if (!pinned) return release(digest);
  if (!is_new) return;
  // Otherwise the server would tell a client that repeats the upload that it has the mesh.
  std::lock_guard lock(mutex_);
  if (const auto entry = entries_.find(digest); entry != entries_.end() && entry->second.references == 0) drop(entry);
}

Answer<std::unique_ptr<BlobWriter>> DirectoryMeshStore::create() {
  std::filesystem::path path = temporary_path();
  const int file = ::open(path.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (file < 0) return cannot_store("a file cannot be created");
  return std::make_unique<Writer>(this, file, std::move(path));
}

int DirectoryMeshStore::open_file(Entries::const_iterator entry) const {
  return ::open(path_of(entry->first, entry->second.form).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
}

Answer<std::shared_ptr<const Blob>> DirectoryMeshStore::open(const std::string& digest) {
  std::unique_lock lock(mutex_);
  const auto entry = entries_.find(digest);
  if (entry == entries_.end()) return mesh_not_found(digest);
  entry->second.touched = settings_.clock();
  const auto size = static_cast<std::size_t>(entry->second.size);
  const Form form = entry->second.form;
  const int file = open_file(entry);
  lock.unlock();
  if (file < 0) return unreadable(digest);
  if (form == Form::Zstd) {
    auto expanded = expand_file(file, directory_);
    if (expanded == nullptr && errno == ENOSPC)
      return store_full("The mesh " + digest + " is compressed, and the server's disk has no room to expand it");
    if (expanded == nullptr) return unreadable(digest);
    return expanded;
  }
  auto mapped = map_file(file, size);
  const int reason = errno;
  ::close(file);
  errno = reason;
  if (mapped == nullptr) return unreadable(digest);
  return mapped;
}

Answer<std::unique_ptr<BlobReader>> DirectoryMeshStore::read(const std::string& digest) {
  std::unique_lock lock(mutex_);
  const auto entry = entries_.find(digest);
  if (entry == entries_.end()) return mesh_not_found(digest);
  entry->second.touched = settings_.clock();
  const Form form = entry->second.form;
  const int file = open_file(entry);
  lock.unlock();
  if (file < 0) return unreadable(digest);
  errno = EIO;
  auto reader = read_file(file, form);
  if (reader == nullptr) return unreadable(digest);
  return reader;
}

bool DirectoryMeshStore::pin(const std::string& digest) {
  std::int64_t size = 0;
  return pin(digest, &size);
}

bool DirectoryMeshStore::pin(const std::string& digest, std::int64_t* size) {
  std::lock_guard lock(mutex_);
  const auto entry = entries_.find(digest);
  if (entry == entries_.end()) return false;
  *size = entry->second.size;
  entry->second.pinned = true;
  entry->second.touched = settings_.clock();
  return true;
}

void DirectoryMeshStore::retain(const std::string& digest) {
  std::lock_guard lock(mutex_);
  if (const auto entry = entries_.find(digest); entry != entries_.end()) ++entry->second.references;
}

void DirectoryMeshStore::release(const std::string& digest) {
  std::lock_guard lock(mutex_);
  const auto entry = entries_.find(digest);
  if (entry == entries_.end() || --entry->second.references > 0) return;
  entry->second.references = 0;  // a mesh that was not in the store when it was retained may be in it now
  entry->second.touched = settings_.clock();
  if (!entry->second.pinned) drop(entry);
}

void DirectoryMeshStore::drop(Entries::iterator entry) {
  std::error_code ignored;
  for (const Form form : {Form::Plain, Form::Zstd}) std::filesystem::remove(path_of(entry->first, form), ignored);
  entries_.erase(entry);
}

}  // namespace varimesh::server
