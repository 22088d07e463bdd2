// The stored meshes. Uploads are in uploads.cpp, sweeping is in sweep.cpp.
#include "server/meshes/shared/shared_mesh_store.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "server/meshes/blobs.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

std::string mark_name(const std::string& digest, const std::string& owner) {
  return digest + "." + mark_of(digest, owner);
}

std::string kept_name(const std::string& digest) { return digest + ".kept"; }

}  // namespace

SharedMeshStore::SharedMeshStore(std::unique_ptr<ObjectStore> objects, SharedMeshSettings settings, AskNeeded needed)
    : objects_(std::move(objects)), settings_(std::move(settings)), needed_(std::move(needed)) {}

SharedMeshStore::~SharedMeshStore() = default;

bool SharedMeshStore::has_room(std::int64_t bytes) const {
  return disk_has_room(objects_->directory(), settings_.meshes.reserve_bytes, bytes);
}

bool SharedMeshStore::has(const std::string& name) {
  const auto found = objects_->find(name, settings_.for_clients);
  return found && *found;
}

Answer<std::int64_t> SharedMeshStore::size_of(const std::string& digest) {
  if (!is_sha256(digest)) return mesh_not_found(digest);
  const auto found = objects_->find(digest, settings_.for_clients);
  if (!found) return tl::unexpected(found.error());
  if (!*found) return mesh_not_found(digest);
  return (*found)->size;
}

// ===== writing =====

Answer<std::unique_ptr<BlobWriter>> SharedMeshStore::create(std::optional<std::int64_t> announced) {
  const Patience patience = announced ? settings_.for_clients : settings_.for_jobs;
  return start_part(
      objects_->new_path(), announced, promised_, [this](std::int64_t bytes) { return has_room(bytes); },
      [this, patience](const std::filesystem::path& part, int, StoredBytes stored) {
        return adopt(part, std::move(stored), false, patience);
      });
}

Answer<StoredBytes> SharedMeshStore::adopt(const std::filesystem::path& path, StoredBytes stored, bool pinned,
                                           Patience patience) {
  const auto tag = objects_->put_file(stored.digest, path, stored.size, patience);
  if (!tag) return tl::unexpected(tag.error());
  if (pinned) {
    const auto noted = objects_->put(kept_name(stored.digest), {}, patience);
    if (!noted) return tl::unexpected(noted.error());
    return stored;
  }
  std::lock_guard lock(mutex_);
  fresh_[stored.digest] = {settings_.meshes.clock(), *tag};
  return stored;
}

void SharedMeshStore::release(const std::string& digest) {
  if (!is_sha256(digest)) return;
  const auto now = settings_.meshes.clock();
  {
    std::lock_guard lock(mutex_);
    if (const auto found = fresh_.find(digest); found != fresh_.end()) {
      released_[digest] = {now, found->second.tag};
      fresh_.erase(found);
      return;
    }
  }
  const auto found = objects_->find(digest, settings_.for_clients);
  if (!found || !*found) return;  // the server that sweeps deletes it
  std::lock_guard lock(mutex_);
  released_[digest] = {now, (*found)->tag};
}

// ===== reading =====

template <class Opened>
Answer<Opened> SharedMeshStore::open_with(const std::string& digest, Patience patience,
                                          const std::function<Opened(const OpenObject&)>& load) {
  if (!is_sha256(digest)) return mesh_not_found(digest);
  std::string version;
  int reason = 0;
  for (const bool again : {false, true}) {
    const auto got = objects_->get(digest, again, patience);
    if (!got) return tl::unexpected(got.error());
    if (Opened opened = load(*got); opened != nullptr) return opened;
    reason = errno;
    if (reason == ENOSPC || reason == EDQUOT)
      return store_full("The server's disk has no room to open the mesh " + digest);
    version = got->version;
  }
  // A disk or a network may have failed for a moment. Only bytes that were read twice and are others are damaged.
  if (reason != EBADMSG || !objects_->set_aside(digest, version))
    return internal_failure("The mesh " + digest + " cannot be read from the store (" +
                            (reason == EBADMSG ? "its bytes have changed" : std::strerror(reason)) + "); try again.");
  settings_.meshes.log("The stored mesh " + digest +
                       " is damaged (its bytes have changed) and was moved to the folder 'damaged'; the next upload "
                       "with this digest is taken. Check the disk.");
  return damaged_mesh(digest, "its bytes have changed");
}

Answer<std::shared_ptr<const Blob>> SharedMeshStore::open(const std::string& digest) {
  return open_with<std::shared_ptr<const Blob>>(digest, settings_.for_jobs, [&](const OpenObject& got) {
    return load_file(got.file, Form::Plain, {digest, got.size}, objects_->scratch());
  });
}

Answer<std::unique_ptr<BlobReader>> SharedMeshStore::read(const std::string& digest) {
  return open_with<std::unique_ptr<BlobReader>>(digest, settings_.for_clients, [&](const OpenObject& got) {
    return read_file(got.file, Form::Plain, {digest, got.size});
  });
}

// ===== use, owners and removal =====

bool SharedMeshStore::touch(const std::string& digest) {
  if (!is_sha256(digest)) return false;
  const auto used = objects_->use(digest, settings_.for_clients);
  return used && *used;
}

bool SharedMeshStore::pin(const std::string& digest) {
  const auto pinned = pin_and_measure(digest, "");
  return pinned && *pinned;
}

Answer<std::optional<std::int64_t>> SharedMeshStore::pin_and_measure(const std::string& digest,
                                                                     const std::string& owner) {
  using Result = std::optional<std::int64_t>;
  if (!is_sha256(digest)) return Result();
  for (const std::string& name : {digest, owner.empty() ? digest : mark_name(digest, owner)}) {
    const auto found = objects_->find(name, settings_.for_clients);
    if (!found) return tl::unexpected(found.error());
    if (!*found) return Result();
  }
  if (const auto noted = objects_->put(kept_name(digest), {}, settings_.for_clients); !noted)
    return tl::unexpected(noted.error());
  const auto used = objects_->use(digest, settings_.for_clients);
  if (!used) return tl::unexpected(used.error());
  return *used ? Result((*used)->size) : Result();
}

bool SharedMeshStore::belongs_to(const std::string& digest, const std::string& owner) {
  return is_sha256(digest) && has(digest) && (owner.empty() || has(mark_name(digest, owner)));
}

void SharedMeshStore::grant(const std::string& digest, const std::string& owner) {
  if (owner.empty() || !is_sha256(digest)) return;
  // A worker grants what it has just stored.
  if (const auto noted = objects_->put(mark_name(digest, owner), {}, settings_.for_jobs); !noted)
    settings_.meshes.log("The owner of the mesh " + digest + " cannot be noted: " + noted.error().sentence);
}

std::function<Answer<bool>()> SharedMeshStore::unless_needed(const std::string& digest) const {
  return [this, digest] { return needed_({digest}).map([](const Digests& needed) { return needed.empty(); }); };
}

Answer<void> SharedMeshStore::remove(const std::string& digest, const std::string& owner) {
  if (!is_sha256(digest)) return mesh_not_found(digest);
  // Whoever stores or uses the mesh from now on changes its tag.
  const auto before = objects_->find(digest, settings_.for_clients);
  if (!before) return tl::unexpected(before.error());
  if (!*before || !belongs_to(digest, owner)) return mesh_not_found(digest);
  const auto needed = needed_({digest});
  if (!needed) return tl::unexpected(needed.error());
  if (owner.empty() && !needed->empty()) return mesh_in_use(digest);
  if (!owner.empty()) {
    if (const auto removed = objects_->remove(mark_name(digest, owner), settings_.for_clients); !removed)
      return removed;
    const auto notes = objects_->list(digest + ".", settings_.for_clients);
    if (!notes) return tl::unexpected(notes.error());
    const bool has_owners =
        std::ranges::any_of(*notes, [&](const Object& note) { return is_sha256(note.name.substr(digest.size() + 1)); });
    if (!needed->empty() || has_owners) return {};
  }
  const auto removed = objects_->remove_unused(digest, (*before)->tag, unless_needed(digest), settings_.for_clients);
  if (!removed) return tl::unexpected(removed.error());
  if (!*removed && owner.empty()) return mesh_in_use(digest);
  return {};
}

}  // namespace varimesh::server
