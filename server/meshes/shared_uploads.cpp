// Uploads into the shared directory. A stream may continue at another server what a stream there began.
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <sstream>

#include "core/base/write_all.h"
#include "server/meshes/shared_mesh_store.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

/// Returns the digest of a file's bytes; nothing if they cannot be read (errno).
std::optional<std::string> digest_of(const std::filesystem::path& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
  if (file < 0) return std::nullopt;
  Sha256 hash;
  std::string buffer(1 << 20, '\0');
  ssize_t read = 0;
  while ((read = ::read(file, buffer.data(), buffer.size())) > 0)
    hash.update(std::string_view(buffer.data(), static_cast<std::size_t>(read)));
  const int reason = errno;
  ::close(file);
  errno = reason;
  return read < 0 ? std::nullopt : std::optional(hash.finish());
}

}  // namespace

/// The file is locked as long as this object exists.
class SharedMeshStore::About {
 public:
  /// Opens what is known about an upload. `make`: makes the file if there is none. Null if there is none, or if it
  /// cannot be made (errno).
  static std::unique_ptr<About> open(const std::filesystem::path& bytes, bool make) {
    const std::filesystem::path path = bytes.string() + ".about";
    while (true) {
      const int file = ::open(path.c_str(), (make ? O_CREAT : 0) | O_RDWR | O_CLOEXEC | O_NOFOLLOW, 0600);
      if (file < 0) return nullptr;
      std::unique_ptr<About> about(new About(file, bytes, path));
      struct stat status {
      }, at_path{};
      if (::flock(file, LOCK_EX) != 0 || ::fstat(file, &status) != 0) return nullptr;
      // The upload may have ended while this stream waited.
      if (::lstat(path.c_str(), &at_path) != 0 || at_path.st_ino != status.st_ino) continue;
      about->read();
      return !about->digest.empty() || make ? std::move(about) : nullptr;
    }
  }
  ~About() { ::close(file_); }

  /// Notes the digest, the size and the generation. Returns false if that fails (errno).
  bool write() const {
    std::ostringstream text;
    text << digest << ' ' << size << ' ' << generation << '\n';
    return ::ftruncate(file_, 0) == 0 && ::lseek(file_, 0, SEEK_SET) == 0 && write_all(file_, text.str());
  }
  /// The number of bytes that were received.
  std::int64_t committed() const {
    struct stat status {};
    return ::lstat(bytes.c_str(), &status) == 0 ? status.st_size : 0;
  }
  /// The upload has ended.
  void forget() const {
    ::unlink(bytes.c_str());
    ::unlink(path_.c_str());
  }

  const std::filesystem::path bytes;
  std::string digest;  ///< Empty: the upload is new.
  std::int64_t size = 0, generation = 0;

 private:
  About(int file, std::filesystem::path bytes, std::filesystem::path path)
      : bytes(std::move(bytes)), file_(file), path_(std::move(path)) {}
  void read() {
    char text[256] = {};
    const ssize_t length = ::pread(file_, text, sizeof text - 1, 0);
    std::istringstream fields(std::string(text, static_cast<std::size_t>(std::max<ssize_t>(length, 0))));
    // A server that ended while it wrote has left a part of the line. Then the upload begins again.
    if (!(fields >> digest >> size >> generation) || !is_sha256(digest)) digest.clear(), size = generation = 0;
  }

  const int file_;
  const std::filesystem::path path_;
};

std::filesystem::path SharedMeshStore::upload_path(const std::string& id, const std::string& owner) const {
  return directory_ / ("upload-" + sha256(owner + '\0' + id));
}

std::shared_ptr<const void> SharedMeshStore::room_for(const std::string& key, std::int64_t left) {
  std::lock_guard lock(mutex_);
  std::erase_if(promises_, [](const auto& entry) { return entry.second.expired(); });
  std::weak_ptr<Promise>& known = promises_[key];
  std::shared_ptr<Promise> promise = known.lock();
  if (promise != nullptr) return promise;
  if (!has_room(left + promised_)) return nullptr;
  promise = std::make_shared<Promise>(promised_, left);
  known = promise;
  return promise;
}

std::shared_ptr<Promise> SharedMeshStore::promise_of(const std::string& key) {
  std::lock_guard lock(mutex_);
  const auto found = promises_.find(key);
  return found == promises_.end() ? nullptr : found->second.lock();
}

Answer<UploadTicket> SharedMeshStore::begin_upload(const std::string& id, const std::string& digest, std::int64_t size,
                                                   const std::string& owner) {
  if (const auto checked = check_upload(id, digest, size, settings_.max_mesh_bytes, settings_.max_memory_bytes);
      !checked)
    return tl::unexpected(checked.error());
  const std::filesystem::path path = upload_path(id, owner);
  if (pin_and_measure(digest, owner)) return UploadTicket{id, 0, size, true, nullptr, owner};
  const auto about = About::open(path, true);
  if (about == nullptr) return cannot_store("a file cannot be created");
  // Another stream may have stored the mesh while this one waited for the lock.
  if (about->digest.empty() && pin_and_measure(digest, owner)) {
    about->forget();
    return UploadTicket{id, 0, size, true, nullptr, owner};
  }
  if (about->digest.empty()) {
    about->digest = digest;
    about->size = size;
  }
  if (about->digest != digest || about->size != size) return upload_id_used(id);
  // Its file is not there either if a server was killed between the end of the upload and its answer.
  const int is_new = about->generation == 0 ? O_TRUNC : 0;
  const int file = ::open(path.c_str(), O_CREAT | is_new | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (file < 0) return cannot_store("a file cannot be created");
  ::close(file);
  const std::int64_t committed = about->committed();
  auto room = room_for(path.filename().string(), size - committed);
  if (!room) {
    if (committed == 0) about->forget();
    return store_full("The server's disk has no room for a mesh of " + std::to_string(size) + " bytes");
  }
  about->generation = next_stream();
  if (!about->write()) return cannot_store("a file cannot be written");
  return UploadTicket{id, about->generation, committed, false, std::move(room), owner};
}

Answer<std::int64_t> SharedMeshStore::append(const UploadTicket& ticket, std::int64_t offset, std::string_view bytes) {
  const std::filesystem::path path = upload_path(ticket.id, ticket.owner);
  const auto about = About::open(path, false);
  if (about == nullptr) return upload_not_found("The upload '" + ticket.id + "' is no longer known");
  if (about->generation != ticket.generation) return upload_taken_over();
  const std::int64_t committed = about->committed();
  if (offset != committed) return chunk_out_of_order(offset, committed);
  const auto more = static_cast<std::int64_t>(bytes.size());
  if (more > about->size - committed) {
    about->forget();
    return upload_larger_than_declared(about->size);
  }
  if (!write_at(path, committed, bytes)) return cannot_store("the disk cannot take more data");
  if (const auto promise = promise_of(path.filename().string())) promise->keep(more);
  return committed + more;
}

Answer<StoredBytes> SharedMeshStore::finish_upload(const UploadTicket& ticket) {
  const std::filesystem::path path = upload_path(ticket.id, ticket.owner);
  // The lock is held to the end, so a stream that begins the upload again meanwhile waits for the outcome.
  const auto about = About::open(path, false);
  if (about == nullptr) return upload_not_found("The upload '" + ticket.id + "' is no longer known");
  if (about->generation != ticket.generation) return upload_taken_over();
  const std::int64_t committed = about->committed();
  if (committed != about->size)
    return bad_request("The stream ended after " + std::to_string(committed) + " of " + std::to_string(about->size) +
                           " bytes; continue from there, or start again.",
                       {{"committed_size", std::to_string(committed)}});
  // Several servers may have received the bytes, so they are read once more.
  const auto digest = digest_of(path);
  if (!digest) return cannot_store("a file cannot be read");
  if (*digest != about->digest) {
    about->forget();
    return digest_mismatch(*digest, about->digest);
  }
  const int file = ::open(path.c_str(), O_WRONLY | O_CLOEXEC | O_NOFOLLOW);
  if (file < 0) return cannot_store("a file cannot be opened");
  auto stored = adopt(path, file, {*digest, about->size}, true);
  ::close(file);
  if (stored && !mark(*digest, ticket.owner)) stored = cannot_store("the owner of the mesh cannot be noted");
  about->forget();
  return stored;
}

Answer<UploadProgress> SharedMeshStore::query_upload(const std::string& id, const std::string& digest,
                                                     const std::string& owner) {
  if (const auto size = pin_and_measure(digest, owner)) return UploadProgress{*size, true};
  if (const auto about = About::open(upload_path(id, owner), false)) return UploadProgress{about->committed(), false};
  // The upload may have been finished since the first line.
  if (const auto size = pin_and_measure(digest, owner)) return UploadProgress{*size, true};
  return upload_not_found("Neither this upload nor this mesh is known");
}

void SharedMeshStore::drop_upload(const std::string& name) {
  const auto about = About::open(directory_ / name, false);
  if (about == nullptr) return;
  struct stat status {};
  const auto seen = seen_.find(name + ".about");
  if (::lstat((about->bytes.string() + ".about").c_str(), &status) == 0 && seen != seen_.end() &&
      time_of_change(status) == seen->second.changed)
    about->forget();
}

}  // namespace varimesh::server
