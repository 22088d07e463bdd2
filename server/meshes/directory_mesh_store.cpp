// Uploads, and what is stored; directory_upkeep.cpp has what is done when nobody asks.
#include "server/meshes/directory_mesh_store.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <tuple>
#include <vector>

#include "core/base/write_all.h"
#include "server/meshes/directory_upload.h"
#include "server/meshes/sha256.h"

namespace varimesh::server {
namespace {

using Code = Failure::Code;

tl::unexpected<Failure> store_full(const char* what) {
  return failure(Code::ResourceExhausted, "STORE_FULL",
                 std::string("The server cannot keep the mesh: ") + what + " (" + std::strerror(errno) +
                     "); free disk space there, or ask whoever runs it.",
                 {}, 30);
}

tl::unexpected<Failure> not_there(const std::string& digest) {
  return failure(Code::NotFound, "MESH_NOT_FOUND", "The mesh " + digest + " is not in the store; upload it.",
                 {{"digest", digest}});
}

}  // namespace

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
    return failure(Code::Unavailable, "STORE_FULL",
                   "Cannot make a directory for meshes in '" + base.string() + "' (" + std::strerror(errno) +
                       "); name another one (TMPDIR, or --data of the server).");
  return std::unique_ptr<DirectoryMeshStore>(new DirectoryMeshStore(name, std::move(settings), false));
}

Answer<std::unique_ptr<DirectoryMeshStore>> DirectoryMeshStore::open_directory(const std::string& directory,
                                                                               DirectoryMeshSettings settings) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error || ::access(directory.c_str(), R_OK | W_OK | X_OK) != 0)
    return failure(Code::Unavailable, "STORE_FULL",
                   "Cannot keep meshes in '" + directory + "' (" + (error ? error.message() : std::strerror(errno)) +
                       "); name another directory (--state).");
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

// ===== uploads =====

Answer<UploadTicket> DirectoryMeshStore::begin_upload(const std::string& id, const std::string& digest,
                                                      std::int64_t size) {
  if (id.empty() || id.size() > 128)
    return failure(Code::InvalidArgument, "BAD_REQUEST", "The upload id must have 1 to 128 bytes.");
  if (!is_digest(digest))
    return failure(Code::InvalidArgument, "BAD_REQUEST",
                   "The digest must be the mesh's SHA-256 as 64 hexadecimal digits in small letters.");
  if (size < 0 || size > settings_.max_mesh_bytes)
    return failure(Code::ResourceExhausted, "MESH_TOO_LARGE",
                   "The mesh has " + std::to_string(size) + " bytes, and the server takes at most " +
                       std::to_string(settings_.max_mesh_bytes) + " (its flag --max-mesh-bytes).",
                   {{"max_mesh_bytes", std::to_string(settings_.max_mesh_bytes)}});
  while (true) {
    if (pin(digest)) return UploadTicket{id, 0, size, true};
    if (!has_room(size))
      return failure(Code::ResourceExhausted, "STORE_FULL",
                     "The server's disk has no room for a mesh of " + std::to_string(size) +
                         " bytes; free space there, or ask whoever runs it.",
                     {}, 30);
    const auto found = find_or_make(id, digest, size);
    if (!found) return tl::unexpected(found.error());
    Upload& upload = **found;
    // A stream that is bringing it to the disk has the lock, and then the mesh is there.
    std::lock_guard lock(upload.mutex);
    if (upload.ended) continue;
    if (upload.digest != digest || upload.size != size)
      return failure(Code::AlreadyExists, "UPLOAD_ID_USED",
                     "The upload id '" + id + "' belongs to an upload of another mesh; choose a new one.");
    upload.touched = settings_.clock();
    return UploadTicket{id, ++upload.generation, upload.committed, false};
  }
}

Answer<std::shared_ptr<DirectoryMeshStore::Upload>> DirectoryMeshStore::find_or_make(const std::string& id,
                                                                                     const std::string& digest,
                                                                                     std::int64_t size) {
  const std::filesystem::path path = temporary_path();
  std::lock_guard lock(mutex_);
  drop_old_uploads();
  std::shared_ptr<Upload>& upload = uploads_[id];
  if (upload != nullptr) return upload;
  auto made = std::make_shared<Upload>();
  made->digest = digest;
  made->size = size;
  made->touched = settings_.clock();
  made->file = ::open(path.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0600);
  if (made->file < 0) {
    uploads_.erase(id);
    return store_full("no file can be made");
  }
  made->path = path;
  return upload = std::move(made);
}

Answer<std::shared_ptr<DirectoryMeshStore::Upload>> DirectoryMeshStore::find(const UploadTicket& ticket) {
  std::lock_guard lock(mutex_);
  const auto found = uploads_.find(ticket.id);
  if (found == uploads_.end())
    return failure(Code::NotFound, "UPLOAD_NOT_FOUND",
                   "The upload '" + ticket.id + "' is not known any more; begin it again.");
  return found->second;
}

Answer<std::int64_t> DirectoryMeshStore::append(const UploadTicket& ticket, std::int64_t offset,
                                                std::string_view bytes) {
  const auto found = find(ticket);
  if (!found) return tl::unexpected(found.error());
  Upload& upload = **found;
  std::lock_guard lock(upload.mutex);
  if (upload.generation != ticket.generation)
    return failure(Code::Aborted, "UPLOAD_TAKEN_OVER", "Another stream goes on with this upload.");
  if (offset != upload.committed)
    return failure(Code::OutOfRange, "WRONG_OFFSET",
                   "The chunk begins at " + std::to_string(offset) + ", and " + std::to_string(upload.committed) +
                       " bytes of the upload are here; go on from there.",
                   {{"committed_size", std::to_string(upload.committed)}});
  if (static_cast<std::int64_t>(bytes.size()) > upload.size - upload.committed) {
    forget(ticket.id, upload);  // nothing of it is kept
    return failure(Code::InvalidArgument, "MESH_LARGER_THAN_SAID",
                   "More bytes come than the " + std::to_string(upload.size) +
                       " that the header says; upload the mesh again under a new id.");
  }
  if (!write_all(upload.file, bytes)) {
    // Some of the chunk may be in the file: what is committed stays the truth.
    const int reason = errno;
    if (::ftruncate(upload.file, upload.committed) == 0) ::lseek(upload.file, upload.committed, SEEK_SET);
    errno = reason;
    return store_full("the disk takes no more");
  }
  upload.hash.update(bytes);
  upload.committed += static_cast<std::int64_t>(bytes.size());
  upload.touched = settings_.clock();
  return upload.committed;
}

Answer<StoredBytes> DirectoryMeshStore::finish_upload(const UploadTicket& ticket) {
  const auto found = find(ticket);
  if (!found) return tl::unexpected(found.error());
  Upload& upload = **found;
  // Held to the end: whoever begins the upload again meanwhile is answered when it is known what came of it.
  std::lock_guard lock(upload.mutex);
  if (upload.generation != ticket.generation)
    return failure(Code::Aborted, "UPLOAD_TAKEN_OVER", "Another stream goes on with this upload.");
  if (upload.committed != upload.size)
    return failure(Code::InvalidArgument, "BAD_REQUEST",
                   "The stream ended after " + std::to_string(upload.committed) + " of " + std::to_string(upload.size) +
                       " bytes; go on from there, or begin again.",
                   {{"committed_size", std::to_string(upload.committed)}});
  const StoredBytes stored{upload.hash.finish(), upload.size};
  auto result = stored.digest == upload.digest
                    ? adopt(upload.path, upload.file, stored, true)
                    : Answer<StoredBytes>(failure(Code::InvalidArgument, "DIGEST_MISMATCH",
                                                  "The bytes that came have the SHA-256 " + stored.digest +
                                                      ", and the header says " + upload.digest +
                                                      "; upload the mesh again under a new id.",
                                                  {{"digest", stored.digest}}));
  forget(ticket.id, upload);
  return result;
}

void DirectoryMeshStore::forget(const std::string& id, Upload& upload) {
  ++upload.generation;
  upload.ended = true;
  std::lock_guard lock(mutex_);
  if (const auto found = uploads_.find(id); found != uploads_.end() && found->second.get() == &upload)
    uploads_.erase(found);
}

Answer<UploadProgress> DirectoryMeshStore::query_upload(const std::string& id, const std::string& digest) {
  std::int64_t size = 0;
  if (pin(digest, &size)) return UploadProgress{size, true};
  if (const auto found = find({id, 0, 0, false})) {
    std::lock_guard lock((*found)->mutex);
    if (!(*found)->ended) return UploadProgress{(*found)->committed, false};
  }
  // It may have been finished just now.
  if (pin(digest, &size)) return UploadProgress{size, true};
  return failure(Code::NotFound, "UPLOAD_NOT_FOUND", "Neither this upload nor this mesh is known; begin from 0.");
}

// ===== stored bytes =====

Answer<StoredBytes> DirectoryMeshStore::adopt(const std::filesystem::path& path, int file, StoredBytes stored,
                                              bool pinned) {
  if (durable_ && ::fdatasync(file) != 0) return store_full("a file cannot be brought to the disk");
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
        return store_full("a finished file cannot be renamed");
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
    return store_full("a directory cannot be brought to the disk");
  }
  return stored;
}

void DirectoryMeshStore::take_back(const std::string& digest, bool pinned, bool is_new) {
  if (!pinned) return release(digest);
  if (!is_new) return;
  // A mesh that stays would be said to be there when the upload is tried again.
  std::lock_guard lock(mutex_);
  if (const auto entry = entries_.find(digest); entry != entries_.end() && entry->second.references == 0) drop(entry);
}

Answer<std::unique_ptr<BlobWriter>> DirectoryMeshStore::create() {
  std::filesystem::path path = temporary_path();
  const int file = ::open(path.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0600);
  if (file < 0) return store_full("no file can be made");
  return std::make_unique<Writer>(this, file, std::move(path));
}

int DirectoryMeshStore::open_file(Entries::const_iterator entry) const {
  return ::open(path_of(entry->first, entry->second.form).c_str(), O_RDONLY | O_CLOEXEC);
}

tl::unexpected<Failure> DirectoryMeshStore::unreadable(const std::string& digest) const {
  return failure(Code::Internal, "INTERNAL",
                 "The mesh " + digest + " cannot be read from the store (" + std::strerror(errno) + ").");
}

Answer<std::shared_ptr<const Blob>> DirectoryMeshStore::open(const std::string& digest) {
  std::unique_lock lock(mutex_);
  const auto entry = entries_.find(digest);
  if (entry == entries_.end()) return not_there(digest);
  entry->second.touched = settings_.clock();
  const auto size = static_cast<std::size_t>(entry->second.size);
  const Form form = entry->second.form;
  const int file = open_file(entry);
  lock.unlock();
  if (file < 0) return unreadable(digest);
  if (form == Form::Zstd) {
    auto expanded = expand_file(file, directory_);
    if (expanded == nullptr && errno == ENOSPC)
      return store_full("it is compressed, and there is no room to expand it");
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
  if (entry == entries_.end()) return not_there(digest);
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
  entry->second.references = 0;  // what was not there when it was retained may be there now
  entry->second.touched = settings_.clock();
  if (!entry->second.pinned) drop(entry);
}

void DirectoryMeshStore::drop(Entries::iterator entry) {
  std::error_code ignored;
  for (const Form form : {Form::Plain, Form::Zstd}) std::filesystem::remove(path_of(entry->first, form), ignored);
  entries_.erase(entry);
}

}  // namespace varimesh::server
