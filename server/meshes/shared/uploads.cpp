// Uploads. A stream may continue at another server what a stream at this one began. In a directory that servers share,
// all of them see the file that receives the bytes. For another place the bytes are received in a file of this server;
// every eight million of them, and the last ones of a stream that was cut, are stored as parts.
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <sstream>

#include "core/base/io/write_all.h"
#include "core/base/sha256.h"
#include "server/meshes/read_at.h"
#include "server/meshes/shared/shared_mesh_store.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

/// After this time some bytes are stored even if they are few, since an upload without news for ten minutes is dropped.
constexpr std::chrono::minutes kStoreAfter{1};

/// Closes the descriptor.
struct File {
  File(const std::filesystem::path& path, int flags)
      : descriptor(::open(path.c_str(), flags | O_CLOEXEC | O_NOFOLLOW, 0600)) {}
  ~File() {
    if (descriptor >= 0) ::close(descriptor);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  explicit operator bool() const { return descriptor >= 0; }
  const int descriptor;
};

/// What an upload is: its digest and size, and the number of the stream that receives it.
std::string about_line(const std::string& digest, std::int64_t size, std::int64_t generation) {
  return digest + ' ' + std::to_string(size) + ' ' + std::to_string(generation) + '\n';
}

/// Whether `about` says that an upload is of another mesh. A server that ended while it wrote has left a part of the
/// line; then the upload begins again.
bool is_of_another(const std::string& about, const std::string& digest, std::int64_t size) {
  std::istringstream fields(about);
  std::string known_digest, receiver;
  std::int64_t known_size = 0;
  if (!(fields >> known_digest >> known_size >> receiver) || !is_sha256(known_digest)) return false;
  return known_digest != digest || known_size != size;
}

std::string upload_key(const std::string& id, const std::string& owner) {
  return "upload-" + sha256(owner + '\0' + id);
}

/// Returns the digest of a file's bytes; nothing if they cannot be read (errno).
std::optional<std::string> digest_of(const std::filesystem::path& path) {
  const File file(path, O_RDONLY);
  Sha256 hash;
  std::string bytes;
  for (std::int64_t at = 0;; at += static_cast<std::int64_t>(bytes.size())) {
    if (!file || !read_at(file.descriptor, at, 1 << 20, &bytes)) return std::nullopt;
    if (bytes.empty()) return hash.finish();
    hash.update(bytes);
  }
}

}  // namespace

/// An upload that this server receives or has received. It holds no descriptor between its messages. Its mutex orders
/// the streams that continue it here; it is locked before the place's lock (ObjectStore::hold()).
struct SharedMeshStore::Upload {
  ~Upload() {
    std::error_code ignored;
    if (!is_seen_by_all && !path.empty()) std::filesystem::remove(path, ignored);
  }
  std::mutex mutex;
  std::string key;    ///< "upload-…".
  std::string about;  ///< What this server has noted of it; empty: nothing.
  std::string digest;
  std::int64_t size = 0;
  std::int64_t base = 0;       ///< The file has the bytes from here on;
  std::int64_t committed = 0;  ///< until here,
  std::int64_t stored = 0;     ///< and until here all servers can read them.
  std::int64_t generation = 0;
  bool ended = false;
  std::filesystem::path path;
  bool is_seen_by_all = false;  ///< All servers receive into the file.
  std::chrono::steady_clock::time_point touched, stored_at;
  std::weak_ptr<Promise> promise;  ///< Of the streams that hold tickets.
};

std::shared_ptr<SharedMeshStore::Upload> SharedMeshStore::find_or_make(const std::string& key) {
  std::lock_guard lock(mutex_);
  std::shared_ptr<Upload>& upload = uploads_[key];
  if (upload != nullptr) return upload;
  upload = std::make_shared<Upload>();
  upload->key = key;
  const auto shared = objects_->upload_file(key);
  upload->is_seen_by_all = shared.has_value();
  upload->path = shared ? *shared : objects_->new_path();
  upload->touched = settings_.meshes.clock();
  return upload;
}

Answer<std::shared_ptr<SharedMeshStore::Upload>> SharedMeshStore::find(const UploadTicket& ticket) {
  std::lock_guard lock(mutex_);
  const auto found = uploads_.find(upload_key(ticket.id, ticket.owner));
  if (found == uploads_.end()) return upload_not_found("The upload '" + ticket.id + "' is no longer known");
  return found->second;
}

// ===== begin =====

Answer<UploadTicket> SharedMeshStore::begin_upload(const std::string& id, const std::string& digest, std::int64_t size,
                                                   const std::string& owner) {
  const DirectoryMeshSettings& limits = settings_.meshes;
  if (const auto checked = check_upload(id, digest, size, limits.max_mesh_bytes, limits.max_memory_bytes); !checked)
    return tl::unexpected(checked.error());
  const UploadTicket complete{id, 0, size, true, nullptr, owner};
  while (true) {
    const auto there = pin_and_measure(digest, owner);
    if (!there) return tl::unexpected(there.error());
    if (*there) return complete;
    const auto upload = find_or_make(upload_key(id, owner));
    // While another stream here finishes this upload it holds the lock; after that the mesh is in the store.
    std::lock_guard lock(upload->mutex);
    if (upload->ended) continue;
    const auto held = objects_->hold(upload->key, true);
    if (held == nullptr) return cannot_store("a file cannot be created");
    auto ticket = take_over(upload, {id, 0, 0, false, nullptr, owner}, digest, size);
    if (!ticket) return tl::unexpected(ticket.error());
    if (*ticket) return std::move(**ticket);
    forget(*upload);
    return complete;
  }
}

Answer<std::optional<UploadTicket>> SharedMeshStore::take_over(const std::shared_ptr<Upload>& shared,
                                                               UploadTicket ticket, const std::string& digest,
                                                               std::int64_t size) {
  Upload& upload = *shared;
  const auto known = objects_->upload_state(upload.key, settings_.for_clients);
  if (!known) return tl::unexpected(known.error());
  if (known->about.empty()) {
    // Another stream may have stored the mesh while this one waited for the place's lock.
    const auto there = pin_and_measure(digest, ticket.owner);
    if (!there) return tl::unexpected(there.error());
    if (*there) return std::optional<UploadTicket>();
  }
  if (is_of_another(known->about, digest, size)) return upload_id_used(ticket.id);
  const bool is_mine = !upload.about.empty() && upload.about == known->about;
  if (!is_mine) {
    upload.committed = upload.stored = known->committed;
    upload.base = upload.is_seen_by_all ? 0 : known->committed;
    // The file of a new upload is a rest of another one, and is not there if a server was killed at its end.
    const bool keeps = upload.is_seen_by_all && known->committed > 0;
    if (!File(upload.path, O_CREAT | O_WRONLY | (keeps ? 0 : O_TRUNC))) return cannot_store("a file cannot be created");
  }
  upload.digest = digest;
  upload.size = size;
  ticket.room = room_for(shared);
  if (ticket.room == nullptr) {
    if (upload.committed == 0) forget(upload);
    return store_full("The server's disk has no room for a mesh of " + std::to_string(size) + " bytes");
  }
  upload.generation = next_stream();
  upload.about = about_line(digest, size, upload.generation);
  if (const auto put = objects_->put(upload.key + ".about", upload.about, settings_.for_clients); !put)
    return tl::unexpected(put.error());
  upload.stored_at = upload.touched = settings_.meshes.clock();
  ticket.generation = upload.generation;
  ticket.committed = upload.committed;
  return std::optional(std::move(ticket));
}

std::shared_ptr<const void> SharedMeshStore::room_for(const std::shared_ptr<Upload>& upload) {
  if (auto promise = upload->promise.lock()) return promise;
  const std::int64_t left = upload->size - upload->committed;
  if (!has_room(left + promised_)) return nullptr;
  // When the streams end before the upload does, what they have sent is stored, for a stream at another server.
  const std::shared_ptr<Promise> promise(new Promise(promised_, left), [this, upload](Promise* ended) {
    delete ended;
    tails_.post([this, upload] {
      std::lock_guard held(upload->mutex);
      if (!upload->ended) [[maybe_unused]]
        const auto flushed = flush(*upload);
    });
  });
  upload->promise = promise;
  return promise;
}

// ===== go on =====

Answer<void> SharedMeshStore::check_mine(const Upload& upload) {
  const auto known = objects_->upload_state(upload.key, settings_.for_clients);
  if (!known) return tl::unexpected(known.error());
  if (known->about.empty()) return upload_not_found("This upload is no longer known");
  if (known->about != upload.about) return upload_taken_over();
  return {};
}

Answer<void> SharedMeshStore::flush(Upload& upload) {
  if (upload.stored == upload.committed) return {};
  if (const auto mine = check_mine(upload); !mine) return mine;
  std::string bytes;
  const File file(upload.path, O_RDONLY);
  if (!file || !read_at(file.descriptor, upload.stored - upload.base,
                        static_cast<std::size_t>(upload.committed - upload.stored), &bytes))
    return cannot_store("a file cannot be read");
  if (const auto put = objects_->put_part(upload.key, upload.stored, bytes, settings_.for_clients); !put) return put;
  upload.stored = upload.committed;
  upload.stored_at = settings_.meshes.clock();
  return {};
}

Answer<std::int64_t> SharedMeshStore::append(const UploadTicket& ticket, std::int64_t offset, std::string_view bytes) {
  const auto found = find(ticket);
  if (!found) return tl::unexpected(found.error());
  Upload& upload = **found;
  std::lock_guard lock(upload.mutex);
  if (upload.ended) return upload_not_found("The upload '" + ticket.id + "' is no longer known");
  if (upload.generation != ticket.generation) return upload_taken_over();
  const auto held = upload.is_seen_by_all ? objects_->hold(upload.key, false) : nullptr;
  if (upload.is_seen_by_all)
    if (const auto mine = check_mine(upload); !mine) return tl::unexpected(mine.error());
  if (offset != upload.committed) return chunk_out_of_order(offset, upload.committed);
  const auto more = static_cast<std::int64_t>(bytes.size());
  if (more > upload.size - upload.committed) {
    const std::int64_t size = upload.size;
    forget(upload);
    return upload_larger_than_declared(size);
  }
  if (!write_at(upload.path, upload.committed - upload.base, bytes))
    return cannot_store("the disk cannot take more data");
  upload.committed += more;
  if (upload.is_seen_by_all) upload.stored = upload.committed;
  if (const auto promise = upload.promise.lock()) promise->keep(more);
  upload.touched = settings_.meshes.clock();
  const bool is_due =
      upload.committed - upload.stored >= settings_.part_bytes || upload.touched - upload.stored_at >= kStoreAfter;
  if (is_due && upload.committed < upload.size)
    if (const auto flushed = flush(upload); !flushed) return tl::unexpected(flushed.error());
  return upload.committed;
}

Answer<UploadProgress> SharedMeshStore::query_upload(const std::string& id, const std::string& digest,
                                                     const std::string& owner) {
  const std::string key = upload_key(id, owner);
  for (const bool again : {false, true}) {
    const auto there = pin_and_measure(digest, owner);
    if (!there) return tl::unexpected(there.error());
    if (*there) return UploadProgress{**there, true};
    const auto known = objects_->upload_state(key, settings_.for_clients);
    if (!known) return tl::unexpected(known.error());
    // The upload may have been finished since the mesh was looked for.
    if (known->about.empty() && !again) continue;
    if (known->about.empty()) break;
    std::shared_ptr<Upload> upload;
    {
      std::lock_guard lock(mutex_);
      if (const auto found = uploads_.find(key); found != uploads_.end()) upload = found->second;
    }
    if (upload == nullptr) return UploadProgress{known->committed, false};
    std::lock_guard lock(upload->mutex);
    const bool is_mine = upload->about == known->about;
    return UploadProgress{is_mine ? std::max(known->committed, upload->committed) : known->committed, false};
  }
  return upload_not_found("Neither this upload nor this mesh is known");
}

// ===== end =====

Answer<void> SharedMeshStore::gather(Upload& upload) {
  if (upload.base == 0) return {};
  const std::filesystem::path whole = objects_->new_path();
  const File to(whole, O_CREAT | O_EXCL | O_WRONLY), from(upload.path, O_RDONLY);
  Answer<void> done;
  if (!to || !from) done = cannot_store("a file cannot be opened");
  if (done) done = objects_->get_parts(upload.key, upload.base, to.descriptor, settings_.for_clients);
  std::string bytes;
  for (std::int64_t at = 0; done && at < upload.committed - upload.base; at += static_cast<std::int64_t>(bytes.size()))
    if (!read_at(from.descriptor, at, 1 << 20, &bytes) || bytes.empty() || !write_all(to.descriptor, bytes))
      done = cannot_store("a file cannot be copied");
  if (done && ::rename(whole.c_str(), upload.path.c_str()) != 0) done = cannot_store("a file cannot be renamed");
  if (done)
    upload.base = 0;
  else
    ::unlink(whole.c_str());
  return done;
}

Answer<StoredBytes> SharedMeshStore::finish_upload(const UploadTicket& ticket) {
  const auto found = find(ticket);
  if (!found) return tl::unexpected(found.error());
  Upload& upload = **found;
  // Held to the end, so that a stream that begins the upload again meanwhile waits for the outcome.
  std::lock_guard lock(upload.mutex);
  if (upload.ended) return upload_not_found("The upload '" + ticket.id + "' is no longer known");
  if (upload.generation != ticket.generation) return upload_taken_over();
  const auto held = objects_->hold(upload.key, false);
  if (const auto mine = check_mine(upload); !mine) return tl::unexpected(mine.error());
  if (upload.committed != upload.size)
    return bad_request("The stream ended after " + std::to_string(upload.committed) + " of " +
                           std::to_string(upload.size) + " bytes; continue from there, or start again.",
                       {{"committed_size", std::to_string(upload.committed)}});
  if (const auto gathered = gather(upload); !gathered) return tl::unexpected(gathered.error());
  // Several servers may have received the bytes, so they are read once more.
  const auto digest = digest_of(upload.path);
  if (!digest) return cannot_store("a file cannot be read");
  if (*digest != upload.digest) {
    const std::string declared = upload.digest;
    forget(upload);
    return digest_mismatch(*digest, declared);
  }
  auto stored = adopt(upload.path, {*digest, upload.size}, true, settings_.for_clients);
  if (!stored) return stored;
  if (!ticket.owner.empty()) {
    const auto noted = objects_->put(*digest + "." + mark_of(*digest, ticket.owner), {}, settings_.for_clients);
    if (!noted) return tl::unexpected(noted.error());
  }
  forget(upload);
  return stored;
}

void SharedMeshStore::forget(Upload& upload) {
  upload.ended = true;
  {
    std::lock_guard lock(mutex_);
    const auto found = uploads_.find(upload.key);
    if (found != uploads_.end() && found->second.get() == &upload) uploads_.erase(found);
  }
  // What is left behind here is swept later.
  [[maybe_unused]] const auto removed = objects_->remove_upload(upload.key, settings_.for_clients);
}

void SharedMeshStore::drop_idle_uploads() {
  std::vector<std::shared_ptr<Upload>> all;
  {
    std::lock_guard lock(mutex_);
    for (const auto& [key, upload] : uploads_) all.push_back(upload);
  }
  for (const auto& upload : all) {
    const std::unique_lock lock(upload->mutex, std::try_to_lock);
    if (!lock || settings_.meshes.clock() - upload->touched < kUploadLifetime) continue;
    upload->ended = true;  // the sweeper deletes its objects
    std::lock_guard held(mutex_);
    uploads_.erase(upload->key);
  }
}

}  // namespace varimesh::server
