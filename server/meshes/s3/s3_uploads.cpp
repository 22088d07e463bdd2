// Uploads into the bucket. The bytes are received in a file of this server. Every eight million of them, and the last
// ones of a stream that was cut, are stored in the bucket, so that a stream may continue at another server.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <sstream>

#include "core/base/sha256.h"
#include "core/base/write_all.h"
#include "server/meshes/read_at.h"
#include "server/meshes/s3/s3_mesh_store.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

/// After this time some bytes are stored even if they are few, since an upload without news for ten minutes is dropped.
constexpr std::chrono::minutes kStoreAfter{1};

std::string about_line(const std::string& digest, std::int64_t size, const std::string& receiver) {
  return digest + ' ' + std::to_string(size) + ' ' + receiver + '\n';
}

std::string part_key(const std::string& key, std::int64_t offset) {
  char digits[32];
  std::snprintf(digits, sizeof digits, "p-%016llx", static_cast<unsigned long long>(offset));
  return key + digits;
}

}  // namespace

/// An upload that this server receives or has received. Its mutex orders the streams that continue it here.
struct S3MeshStore::Upload {
  ~Upload() {
    std::error_code ignored;
    if (!path.empty()) std::filesystem::remove(path, ignored);
  }
  std::mutex mutex;
  std::string key;    ///< Of its objects: "uploads/…/".
  std::string about;  ///< What this server wrote into its object `about`; empty: nothing.
  std::string digest;
  std::int64_t size = 0;
  std::int64_t base = 0;       ///< The file has the bytes from here on;
  std::int64_t committed = 0;  ///< until here,
  std::int64_t stored = 0;     ///< and until here the bucket has them too.
  std::int64_t generation = 0;
  bool ended = false;
  std::filesystem::path path;
  std::chrono::steady_clock::time_point touched, stored_at;
  std::weak_ptr<Promise> promise;  ///< Of the stream that receives it.
};

std::string S3MeshStore::upload_key(const std::string& id, const std::string& owner) {
  return "uploads/" + sha256(owner + '\0' + id) + "/";
}

std::shared_ptr<S3MeshStore::Upload> S3MeshStore::find_or_make(const std::string& key) {
  std::lock_guard lock(mutex_);
  std::shared_ptr<Upload>& upload = uploads_[key];
  if (upload == nullptr) {
    upload = std::make_shared<Upload>();
    upload->key = key;
    upload->path = cache_.new_path();
    upload->touched = settings_.meshes.clock();
  }
  return upload;
}

Answer<std::shared_ptr<S3MeshStore::Upload>> S3MeshStore::find(const UploadTicket& ticket) {
  std::lock_guard lock(mutex_);
  const auto found = uploads_.find(upload_key(ticket.id, ticket.owner));
  if (found == uploads_.end()) return upload_not_found("The upload '" + ticket.id + "' is no longer known");
  return found->second;
}

Answer<S3MeshStore::Progress> S3MeshStore::progress_of(const std::string& key) {
  const auto objects = client_->list(key, settings_.for_clients);
  if (!objects) return tl::unexpected(objects.error());
  Progress progress;
  bool has_about = false;
  for (const S3Object& object : *objects) {
    has_about = has_about || object.key == key + "about";
    if (object.key == part_key(key, progress.committed)) progress.committed += object.size;
  }
  if (!has_about) return Progress{};
  auto about = client_->get_small(key + "about", settings_.for_clients);
  if (!about && about.error().code == Failure::Code::NotFound) return Progress{};
  if (!about) return tl::unexpected(about.error());
  progress.about = std::move(*about);
  return progress;
}

Answer<void> S3MeshStore::take_over(Upload& upload, const Progress& known, const std::string& digest,
                                    std::int64_t size) {
  const bool is_mine = !upload.about.empty() && upload.about == known.about;
  if (!is_mine) {
    upload.base = upload.committed = upload.stored = known.committed;
    const int file = ::open(upload.path.c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (file < 0) return cannot_store("a file cannot be created");
    ::close(file);
  }
  upload.digest = digest;
  upload.size = size;
  upload.about = about_line(digest, size, random_digits());
  const auto put = client_->put(upload.key + "about", upload.about, settings_.for_clients);
  if (!put) return tl::unexpected(put.error());
  upload.stored_at = upload.touched = settings_.meshes.clock();
  upload.generation = next_stream();
  return {};
}

Answer<UploadTicket> S3MeshStore::begin_upload(const std::string& id, const std::string& digest, std::int64_t size,
                                               const std::string& owner) {
  const DirectoryMeshSettings& limits = settings_.meshes;
  if (const auto checked = check_upload(id, digest, size, limits.max_mesh_bytes, limits.max_memory_bytes); !checked)
    return tl::unexpected(checked.error());
  const auto there = pin_and_measure(digest, owner);
  if (!there) return tl::unexpected(there.error());
  if (*there) return UploadTicket{id, 0, size, true, nullptr, owner};
  const std::string key = upload_key(id, owner);
  const auto known = progress_of(key);
  if (!known) return tl::unexpected(known.error());
  std::istringstream fields(known->about);
  std::string known_digest;
  std::int64_t known_size = 0;
  if (fields >> known_digest >> known_size && (known_digest != digest || known_size != size)) return upload_id_used(id);
  const auto upload = find_or_make(key);
  std::lock_guard lock(upload->mutex);
  if (upload->ended) return upload_not_found("The upload '" + id + "' has just ended");
  if (!has_room(size - upload->committed + promised_))
    return store_full("The server's disk has no room for a mesh of " + std::to_string(size) + " bytes");
  if (const auto taken = take_over(*upload, *known, digest, size); !taken) return tl::unexpected(taken.error());
  // When the stream ends before the upload does, what it has sent is stored, for a stream at another server.
  const std::shared_ptr<Promise> room(new Promise(promised_, size - upload->committed),
                                      [this, upload, generation = upload->generation](Promise* promise) {
                                        delete promise;
                                        tails_.post([this, upload, generation] {
                                          std::lock_guard held(upload->mutex);
                                          if (!upload->ended && upload->generation == generation) [[maybe_unused]]
                                            const auto flushed = flush(*upload);
                                        });
                                      });
  upload->promise = room;
  return UploadTicket{id, upload->generation, upload->committed, false, room, owner};
}

Answer<void> S3MeshStore::check_mine(const Upload& upload) {
  const auto about = client_->get_small(upload.key + "about", settings_.for_clients);
  if (!about && about.error().code == Failure::Code::NotFound)
    return upload_not_found("This upload is no longer known");
  if (!about) return tl::unexpected(about.error());
  if (*about != upload.about) return upload_taken_over();
  return {};
}

Answer<void> S3MeshStore::flush(Upload& upload) {
  if (upload.stored == upload.committed) return {};
  if (const auto mine = check_mine(upload); !mine) return mine;
  std::string bytes;
  const int file = ::open(upload.path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
  const bool is_read = file >= 0 && read_at(file, upload.stored - upload.base,
                                            static_cast<std::size_t>(upload.committed - upload.stored), &bytes);
  if (file >= 0) ::close(file);
  if (!is_read) return cannot_store("a file cannot be read");
  const auto put = client_->put(part_key(upload.key, upload.stored), bytes, settings_.for_clients);
  if (!put) return tl::unexpected(put.error());
  upload.stored = upload.committed;
  upload.stored_at = settings_.meshes.clock();
  return {};
}

Answer<std::int64_t> S3MeshStore::append(const UploadTicket& ticket, std::int64_t offset, std::string_view bytes) {
  const auto found = find(ticket);
  if (!found) return tl::unexpected(found.error());
  Upload& upload = **found;
  std::lock_guard lock(upload.mutex);
  if (upload.ended) return upload_not_found("The upload '" + ticket.id + "' is no longer known");
  if (upload.generation != ticket.generation) return upload_taken_over();
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
  if (const auto promise = upload.promise.lock()) promise->keep(more);
  upload.touched = settings_.meshes.clock();
  const bool is_due =
      upload.committed - upload.stored >= S3Client::kPieceBytes || upload.touched - upload.stored_at >= kStoreAfter;
  if (is_due && upload.committed < upload.size)
    if (const auto flushed = flush(upload); !flushed) return tl::unexpected(flushed.error());
  return upload.committed;
}

Answer<void> S3MeshStore::gather(Upload& upload) {
  if (upload.base == 0) return {};
  const std::filesystem::path whole = cache_.new_path();
  const int to = ::open(whole.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0600);
  const int from = ::open(upload.path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
  Answer<void> done;
  if (to < 0 || from < 0) done = cannot_store("a file cannot be opened");
  const auto parts = client_->list(upload.key + "p-", settings_.for_clients);
  if (!parts) done = tl::unexpected(parts.error());
  std::int64_t have = 0;
  for (std::size_t i = 0; done && i < parts->size() && have < upload.base; ++i) {
    const S3Object& part = (*parts)[i];
    if (part.key != part_key(upload.key, have)) continue;
    done = client_->get_file(part.key, part.size, to, settings_.for_clients);
    have += part.size;
  }
  if (done && have != upload.base) done = upload_taken_over();
  std::string bytes;
  for (std::int64_t at = 0; done && at < upload.committed - upload.base; at += static_cast<std::int64_t>(bytes.size()))
    if (!read_at(from, at, 1 << 20, &bytes) || bytes.empty() || !write_all(to, bytes))
      done = cannot_store("a file cannot be copied");
  if (from >= 0) ::close(from);
  if (to >= 0) ::close(to);
  if (done && ::rename(whole.c_str(), upload.path.c_str()) != 0) done = cannot_store("a file cannot be renamed");
  if (!done) ::unlink(whole.c_str());
  if (done) upload.base = 0;
  return done;
}

Answer<StoredBytes> S3MeshStore::finish_upload(const UploadTicket& ticket) {
  const auto found = find(ticket);
  if (!found) return tl::unexpected(found.error());
  Upload& upload = **found;
  // Held to the end, so that a stream that begins the upload again here waits for the outcome.
  std::lock_guard lock(upload.mutex);
  if (upload.ended) return upload_not_found("The upload '" + ticket.id + "' is no longer known");
  if (upload.generation != ticket.generation) return upload_taken_over();
  if (upload.committed != upload.size)
    return bad_request("The stream ended after " + std::to_string(upload.committed) + " of " +
                           std::to_string(upload.size) + " bytes; continue from there, or start again.",
                       {{"committed_size", std::to_string(upload.committed)}});
  if (const auto mine = check_mine(upload); !mine) return tl::unexpected(mine.error());
  if (const auto gathered = gather(upload); !gathered) return tl::unexpected(gathered.error());
  const int file = ::open(upload.path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
  if (file < 0) return cannot_store("a file cannot be opened");
  Sha256 hash;
  std::string bytes;
  for (std::int64_t at = 0; read_at(file, at, 1 << 20, &bytes) && !bytes.empty();
       at += static_cast<std::int64_t>(bytes.size()))
    hash.update(bytes);
  const std::string digest = hash.finish(), declared = upload.digest;
  if (digest != declared) {
    ::close(file);
    forget(upload);
    return digest_mismatch(digest, declared);
  }
  auto stored = adopt(upload.path, file, {digest, upload.size}, true, settings_.for_clients);
  ::close(file);
  if (!stored) return stored;
  if (!ticket.owner.empty()) {
    const auto noted = note(folder_of(digest) + "o-" + mark_of(digest, ticket.owner), settings_.for_clients);
    if (!noted) return tl::unexpected(noted.error());
  }
  forget(upload);
  return stored;
}

Answer<UploadProgress> S3MeshStore::query_upload(const std::string& id, const std::string& digest,
                                                 const std::string& owner) {
  const auto there = pin_and_measure(digest, owner);
  if (!there) return tl::unexpected(there.error());
  if (*there) return UploadProgress{**there, true};
  const std::string key = upload_key(id, owner);
  const auto known = progress_of(key);
  if (!known) return tl::unexpected(known.error());
  if (known->about.empty()) return upload_not_found("Neither this upload nor this mesh is known");
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

void S3MeshStore::forget(Upload& upload) {
  upload.ended = true;
  {
    std::lock_guard lock(mutex_);
    const auto found = uploads_.find(upload.key);
    if (found != uploads_.end() && found->second.get() == &upload) uploads_.erase(found);
  }
  // What is left behind here is swept later.
  const auto objects = client_->list(upload.key, settings_.for_clients);
  if (!objects) return;
  for (const S3Object& object : *objects)
    [[maybe_unused]] const auto removed = client_->remove(object.key, settings_.for_clients);
}

void S3MeshStore::drop_idle_uploads() {
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
