// Uploads: how they begin, continue after a cut, and end.
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>

#include "server/meshes/directory_mesh_store.h"
#include "server/meshes/directory_upload.h"
#include "server/refusals.h"

namespace varimesh::server {

Answer<UploadTicket> DirectoryMeshStore::begin_upload(const std::string& id, const std::string& digest,
                                                      std::int64_t size, const std::string& owner) {
  if (const auto checked = check_upload(id, digest, size, settings_.max_mesh_bytes, settings_.max_memory_bytes);
      !checked)
    return tl::unexpected(checked.error());
  while (true) {
    if (pin_and_measure(digest, owner)) return UploadTicket{id, 0, size, true, nullptr, owner};
    const auto found = find_or_make({id, 0, 0, false, nullptr, owner}, digest, size);
    if (!found) return tl::unexpected(found.error());
    if (*found == nullptr) continue;
    Upload& upload = **found;
    // While another stream finishes this upload it holds the lock; after that the mesh is in the store.
    std::lock_guard lock(upload.mutex);
    if (upload.ended) continue;
    if (upload.digest != digest || upload.size != size) return upload_id_used(id);
    const auto room = room_for(upload);
    if (!room) {
      if (upload.committed == 0) forget({id, 0, 0, false, nullptr, owner}, upload);
      return store_full("The server's disk has no room for a mesh of " + std::to_string(size) + " bytes");
    }
    upload.touched = settings_.clock();
    upload.generation = next_stream();
    return UploadTicket{id, upload.generation, upload.committed, false, room, owner};
  }
}

std::shared_ptr<const void> DirectoryMeshStore::room_for(Upload& upload) {
  std::lock_guard lock(mutex_);
  std::shared_ptr<Promise> promise = upload.promise.lock();
  if (promise != nullptr) return promise;
  const std::int64_t left = upload.size - upload.committed;
  if (!has_room(left + promised_)) return nullptr;
  promise = std::make_shared<Promise>(promised_, left);
  upload.promise = promise;
  return promise;
}

Answer<std::shared_ptr<DirectoryMeshStore::Upload>> DirectoryMeshStore::find_or_make(const UploadTicket& ticket,
                                                                                     const std::string& digest,
                                                                                     std::int64_t size) {
  const std::pair key(ticket.owner, ticket.id);
  const std::filesystem::path path = temporary_path();
  std::lock_guard lock(mutex_);
  drop_old_uploads();
  // Another stream may have stored the mesh since the caller looked. Then there is nothing to upload.
  const auto stored = find_stored(digest);
  if (!uploads_.contains(key) && stored != entries_.end() && belongs(*stored, ticket.owner)) return nullptr;
  if (const auto known = uploads_.find(key); known != uploads_.end()) return known->second;
  if (const auto room = check_share_locked(ticket.owner, size); !room) return tl::unexpected(room.error());
  std::shared_ptr<Upload>& upload = uploads_[key];
  auto made = std::make_shared<Upload>();
  made->digest = digest;
  made->size = size;
  made->touched = settings_.clock();
  const int file = ::open(path.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (file < 0) {
    uploads_.erase(key);
    return cannot_store("a file cannot be created");
  }
  ::close(file);
  made->path = path;
  add_to_share(ticket.owner, size);
  return upload = std::move(made);
}

Answer<std::shared_ptr<DirectoryMeshStore::Upload>> DirectoryMeshStore::find(const UploadTicket& ticket) {
  std::lock_guard lock(mutex_);
  const auto found = uploads_.find({ticket.owner, ticket.id});
  if (found == uploads_.end()) return upload_not_found("The upload '" + ticket.id + "' is no longer known");
  return found->second;
}

Answer<std::int64_t> DirectoryMeshStore::append(const UploadTicket& ticket, std::int64_t offset,
                                                std::string_view bytes) {
  const auto found = find(ticket);
  if (!found) return tl::unexpected(found.error());
  Upload& upload = **found;
  std::lock_guard lock(upload.mutex);
  if (upload.generation != ticket.generation) return upload_taken_over();
  if (offset != upload.committed) return chunk_out_of_order(offset, upload.committed);
  if (static_cast<std::int64_t>(bytes.size()) > upload.size - upload.committed) {
    forget(ticket, upload);
    return upload_larger_than_declared(upload.size);
  }
  if (!write_at(upload.path, upload.committed, bytes)) return cannot_store("the disk cannot take more data");
  if (const auto promise = upload.promise.lock()) promise->keep(static_cast<std::int64_t>(bytes.size()));
  upload.hash.update(bytes);
  upload.committed += static_cast<std::int64_t>(bytes.size());
  upload.touched = settings_.clock();
  return upload.committed;
}

Answer<StoredBytes> DirectoryMeshStore::finish_upload(const UploadTicket& ticket) {
  const auto found = find(ticket);
  if (!found) return tl::unexpected(found.error());
  Upload& upload = **found;
  // The lock is held to the end, so a stream that begins the upload again meanwhile waits for the outcome.
  std::lock_guard lock(upload.mutex);
  if (upload.generation != ticket.generation) return upload_taken_over();
  if (upload.committed != upload.size)
    return bad_request("The stream ended after " + std::to_string(upload.committed) + " of " +
                           std::to_string(upload.size) + " bytes; continue from there, or start again.",
                       {{"committed_size", std::to_string(upload.committed)}});
  const StoredBytes stored{upload.hash.finish(), upload.size};
  if (stored.digest != upload.digest) {
    forget(ticket, upload);
    return digest_mismatch(stored.digest, upload.digest);
  }
  const int file = ::open(upload.path.c_str(), O_WRONLY | O_CLOEXEC | O_NOFOLLOW);
  auto result =
      file < 0 ? Answer<StoredBytes>(cannot_store("a file cannot be opened")) : adopt(upload.path, file, stored, true);
  if (file >= 0) ::close(file);
  if (result)
    if (const auto granted = grant_for_good(stored.digest, ticket.owner); !granted)
      result = tl::unexpected(granted.error());
  forget(ticket, upload);
  return result;
}

void DirectoryMeshStore::forget(const UploadTicket& ticket, Upload& upload) {
  upload.generation = 0;
  upload.ended = true;
  std::lock_guard lock(mutex_);
  if (const auto found = uploads_.find({ticket.owner, ticket.id});
      found != uploads_.end() && found->second.get() == &upload)
    uploads_.erase(found);
}

Answer<UploadProgress> DirectoryMeshStore::query_upload(const std::string& id, const std::string& digest,
                                                        const std::string& owner) {
  if (const auto size = pin_and_measure(digest, owner)) return UploadProgress{*size, true};
  if (const auto found = find({id, 0, 0, false, nullptr, owner})) {
    std::lock_guard lock((*found)->mutex);
    if (!(*found)->ended) return UploadProgress{(*found)->committed, false};
  }
  // The upload may have been finished since the first line.
  if (const auto size = pin_and_measure(digest, owner)) return UploadProgress{*size, true};
  return upload_not_found("Neither this upload nor this mesh is known");
}

}  // namespace varimesh::server
