// The stored meshes. Uploads are in directory_uploads.cpp; compression and sweeping are in directory_upkeep.cpp.
#include "server/meshes/directory_mesh_store.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>
#include <tuple>

#include "server/meshes/directory_upload.h"
#include "server/refusals.h"

namespace varimesh::server {

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
  return disk_has_room(directory_, settings_.reserve_bytes, bytes);
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
    // The new file replaces one that may have been damaged since it was stored.
    std::error_code error;
    std::filesystem::rename(path, path_of(stored.digest, Form::Plain), error);
    if (error) {
      if (is_new) entries_.erase(found);
      errno = error.value();
      return cannot_store("a finished file cannot be renamed");
    }
    if (entry.form == Form::Zstd) std::filesystem::remove(path_of(stored.digest, Form::Zstd), error);
    entry.size = entry.stored = stored.size;
    entry.form = Form::Plain;
    entry.stays_plain = entry.lost = false;
    entry.writing = ++writings_;
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

Answer<std::unique_ptr<BlobWriter>> DirectoryMeshStore::create(std::optional<std::int64_t> announced) {
  return start_part(
      temporary_path(), announced, promised_, [this](std::int64_t bytes) { return has_room(bytes); },
      [this](const std::filesystem::path& part, int file, StoredBytes stored) {
        return adopt(part, file, std::move(stored), false);
      });
}

DirectoryMeshStore::Entries::iterator DirectoryMeshStore::find_stored(const std::string& digest) {
  const auto entry = entries_.find(digest);
  return entry == entries_.end() || entry->second.lost ? entries_.end() : entry;
}

Answer<DirectoryMeshStore::Opened> DirectoryMeshStore::open_file(const std::string& digest) {
  std::lock_guard lock(mutex_);
  const auto entry = find_stored(digest);
  if (entry == entries_.end()) return mesh_not_found(digest);
  entry->second.touched = settings_.clock();
  const Form form = entry->second.form;
  return Opened{::open(path_of(digest, form).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW), form, entry->second.size,
                entry->second.writing};
}

template <class Result>
Answer<Result> DirectoryMeshStore::open_with(const std::string& digest,
                                             const std::function<Result(const Opened&)>& load) {
  std::int64_t writing = 0;
  // A disk may have failed for a moment. Only bytes that were read twice and are others are damaged.
  for (int attempt = 0; attempt < 2; ++attempt) {
    const auto opened = open_file(digest);
    if (!opened) return tl::unexpected(opened.error());
    if (opened->file >= 0)
      if (Result result = load(*opened); result != nullptr) return result;
    if (errno == ENOSPC || errno == EDQUOT)
      return store_full("The server's disk has no room to open the mesh " + digest);
    writing = opened->writing;
  }
  return cannot_read(digest, writing);
}

Answer<std::shared_ptr<const Blob>> DirectoryMeshStore::open(const std::string& digest) {
  return open_with<std::shared_ptr<const Blob>>(digest, [&](const Opened& opened) {
    return load_file(opened.file, opened.form, {digest, opened.size}, directory_);
  });
}

Answer<std::unique_ptr<BlobReader>> DirectoryMeshStore::read(const std::string& digest) {
  return open_with<std::unique_ptr<BlobReader>>(digest, [&](const Opened& opened) {
    return read_file(opened.file, opened.form, {digest, opened.size});
  });
}

std::unique_ptr<BlobCheck> DirectoryMeshStore::check(const std::string& digest) {
  const auto opened = open_file(digest);
  if (!opened || opened->file < 0) return nullptr;
  return check_file(opened->file, opened->form, {digest, opened->size});
}

Answer<std::int64_t> DirectoryMeshStore::size_of(const std::string& digest) {
  std::lock_guard lock(mutex_);
  const auto entry = find_stored(digest);
  if (entry == entries_.end()) return mesh_not_found(digest);
  return entry->second.size;
}

Refusal DirectoryMeshStore::cannot_read(const std::string& digest, std::int64_t writing) {
  const int reason = errno;
  const std::string why = reason == EBADMSG ? "its bytes have changed" : std::strerror(reason);
  // Other reasons, such as too many open files or a disk that does not answer, may pass.
  const bool damaged = reason == EBADMSG || reason == ENOENT || reason == ELOOP;
  std::lock_guard lock(mutex_);
  const auto entry = find_stored(digest);
  const bool is_same = entry != entries_.end() && entry->second.writing == writing;
  if (!damaged || !is_same)
    return internal_failure("The mesh " + digest + " cannot be read from the store (" + why + "); try again.");
  lose(entry, why);
  return damaged_mesh(digest, why);
}

void DirectoryMeshStore::lose(Entries::iterator entry, const std::string& why) {
  settings_.log(
      "The stored mesh " + entry->first + " is damaged (" + why +
      "). What is left of it is in the folder 'damaged'; the next upload with this digest is taken. Check the "
      "disk.");
  for (const Form form : {Form::Plain, Form::Zstd})
    [[maybe_unused]] const bool moved = move_to_damaged(directory_, path_of(entry->first, form).filename().string());
  if (entry->second.references == 0) {
    // A file that could not be moved stays where it is: it may be all that is left of the mesh.
    std::error_code ignored;
    std::filesystem::remove(owners_of(entry->first), ignored);
    entries_.erase(entry);
    return;
  }
  entry->second.lost = true;
  entry->second.pinned = false;
  entry->second.stored = 0;
}

DirectoryMeshStore::Entries::iterator DirectoryMeshStore::use(const std::string& digest) {
  const auto entry = find_stored(digest);
  if (entry == entries_.end()) return entry;
  // A client that is told that the store has the mesh does not send it again.
  struct stat status {};
  const bool is_there = ::lstat(path_of(digest, entry->second.form).c_str(), &status) == 0;
  if (!is_there && errno != ENOENT) return entries_.end();  // the disk may answer the next time
  if (!is_there || !S_ISREG(status.st_mode) || status.st_size != entry->second.stored) {
    lose(entry, is_there ? "its size has changed" : "its file is missing");
    return entries_.end();
  }
  entry->second.touched = settings_.clock();
  return entry;
}

bool DirectoryMeshStore::touch(const std::string& digest) {
  std::lock_guard lock(mutex_);
  return use(digest) != entries_.end();
}

bool DirectoryMeshStore::pin(const std::string& digest) { return pin_and_measure(digest, "").has_value(); }

std::optional<std::int64_t> DirectoryMeshStore::pin_and_measure(const std::string& digest, const std::string& owner) {
  std::lock_guard lock(mutex_);
  const auto entry = use(digest);
  if (entry == entries_.end() || !belongs(*entry, owner)) return std::nullopt;
  entry->second.pinned = true;
  // It stays the owner's without a job, as an upload does.
  if (!owner.empty()) entry->second.owners.insert(mark_of(digest, owner));
  return entry->second.size;
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
  std::filesystem::remove(owners_of(entry->first), ignored);
  entries_.erase(entry);
}

}  // namespace varimesh::server
