// The stored meshes. Uploads are in s3_uploads.cpp, sweeping is in s3_sweep.cpp.
#include "server/meshes/s3/s3_mesh_store.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <random>

#include "core/base/sha256.h"
#include "server/meshes/blobs.h"
#include "server/refusals.h"

namespace varimesh::server {

std::string random_digits() {
  std::random_device device;
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string digits;
  for (int i = 0; i < 2; ++i)
    for (auto [bits, left] = std::pair{device(), 8}; left > 0; --left, bits >>= 4) digits += kDigits[bits & 15];
  return digits;
}

S3MeshStore::S3MeshStore(std::shared_ptr<S3Client> client, const std::string& directory, S3MeshSettings settings,
                         AskNeeded needed)
    : client_(std::move(client)),
      settings_(std::move(settings)),
      needed_(std::move(needed)),
      cache_(directory, settings_.max_cache_bytes) {}

S3MeshStore::~S3MeshStore() = default;

bool S3MeshStore::has_room(std::int64_t bytes) const {
  return disk_has_room(cache_.directory(), settings_.meshes.reserve_bytes, bytes);
}

std::optional<std::int64_t> S3MeshStore::stored_bytes() const {
  return stored_ < 0 ? std::nullopt : std::optional(stored_.load());
}

// ===== what the bucket has =====

const S3MeshStore::Copy* S3MeshStore::Seen::good() const {
  const auto found = std::ranges::find(copies, false, &Copy::marked);
  return found == copies.end() ? nullptr : &*found;
}

Answer<S3MeshStore::Seen> S3MeshStore::look_at(const std::string& digest, S3Patience patience) {
  const std::string folder = folder_of(digest);
  const auto objects = client_->list(folder, patience);
  if (!objects) return tl::unexpected(objects.error());
  Seen seen;
  for (const S3Object& object : *objects) {
    const std::string name = object.key.substr(folder.size());
    if (name.starts_with("g-")) seen.copies.push_back({name.substr(2), object.size});
    if (name.starts_with("o-")) seen.owners.insert(name.substr(2));
    if (name.starts_with("x-")) seen.marks.insert(name.substr(2));
    if (name == "used") seen.used = object.tag;
  }
  for (Copy& copy : seen.copies) {
    const auto mark = seen.marks.lower_bound(copy.name);
    copy.marked = mark != seen.marks.end() && mark->starts_with(copy.name + "-");
  }
  return seen;
}

Answer<void> S3MeshStore::note(const std::string& key, S3Patience patience) {
  return client_->put(key, random_digits(), patience).map([](const std::string&) {});
}

Answer<std::optional<std::int64_t>> S3MeshStore::use(const std::string& digest, S3Patience patience) {
  using Result = std::optional<std::int64_t>;
  if (!is_sha256(digest)) return Result();
  const auto before = look_at(digest, patience);
  if (!before) return tl::unexpected(before.error());
  if (before->good() == nullptr) return Result();
  // Written first and looked at afterwards: see the header.
  if (const auto noted = note(folder_of(digest) + "used", patience); !noted) return tl::unexpected(noted.error());
  const auto seen = look_at(digest, patience);
  if (!seen) return tl::unexpected(seen.error());
  const Copy* const copy = seen->good();
  return copy == nullptr ? Result() : Result(copy->size);
}

Answer<std::int64_t> S3MeshStore::size_of(const std::string& digest) {
  if (!is_sha256(digest)) return mesh_not_found(digest);
  const auto seen = look_at(digest, settings_.for_clients);
  if (!seen) return tl::unexpected(seen.error());
  if (seen->copies.empty()) return mesh_not_found(digest);
  return seen->copies.front().size;
}

// ===== writing =====

Answer<std::unique_ptr<BlobWriter>> S3MeshStore::create(std::optional<std::int64_t> announced) {
  const S3Patience patience = announced ? settings_.for_clients : settings_.for_jobs;
  return start_part(
      cache_.new_path(), announced, promised_, [this](std::int64_t bytes) { return has_room(bytes); },
      [this, patience](const std::filesystem::path& part, int, StoredBytes stored) -> Answer<StoredBytes> {
        const int file = ::open(part.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
        if (file < 0) return cannot_store("a file cannot be opened");
        auto adopted = adopt(part, file, std::move(stored), false, patience);
        ::close(file);
        return adopted;
      });
}

Answer<StoredBytes> S3MeshStore::adopt(const std::filesystem::path& path, int file, StoredBytes stored, bool pinned,
                                       S3Patience patience) {
  const std::string folder = folder_of(stored.digest);
  const auto used = use(stored.digest, patience);
  if (!used) return tl::unexpected(used.error());
  if (!*used) {
    if (const auto put = client_->put_file(folder + "g-" + random_digits(), file, stored.size, patience); !put)
      return tl::unexpected(put.error());
  }
  if (pinned)
    if (const auto noted = note(folder + "kept", patience); !noted) return tl::unexpected(noted.error());
  const auto tag = client_->put(folder + "used", random_digits(), patience);
  if (!tag) return tl::unexpected(tag.error());
  if (!pinned) {
    std::lock_guard lock(mutex_);
    fresh_[stored.digest] = {settings_.meshes.clock(), *tag};
  }
  if (const int copy = cache_.adopt(path, stored.digest, stored.size); copy >= 0) ::close(copy);
  return stored;
}

void S3MeshStore::release(const std::string& digest) {
  std::lock_guard lock(mutex_);
  const auto found = fresh_.find(digest);
  if (found == fresh_.end()) return;  // the server that sweeps deletes what another one has stored
  released_[digest] = {settings_.meshes.clock(), found->second.used};
  fresh_.erase(found);
}

// ===== reading =====

Answer<S3MeshStore::Fetched> S3MeshStore::download(const std::string& digest, const Copy& copy, S3Patience patience) {
  const std::string key = folder_of(digest) + "g-" + copy.name;
  const std::filesystem::path path = cache_.new_path();
  const int part = ::open(path.c_str(), O_CREAT | O_EXCL | O_RDWR | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (part < 0) return cannot_store("a file cannot be created");
  const auto got = client_->get_file(key, copy.size, part, patience);
  ::close(part);
  const bool is_good = got && is_whole(path, Form::Plain, digest);
  const int file = is_good ? cache_.adopt(path, digest, copy.size) : -1;
  if (file < 0) ::unlink(path.c_str());
  if (!got) return tl::unexpected(got.error());
  if (is_good && file < 0) return cannot_store("a file cannot be renamed");
  if (is_good) return Fetched{file, copy.size};
  settings_.meshes.log("The stored mesh " + digest +
                       " is damaged and was removed from the bucket; the next upload with this digest is taken.");
  [[maybe_unused]] const auto removed = client_->remove(key, patience);
  return data_lost("The stored mesh " + digest +
                   " is damaged and was removed from the store; upload it, or run the job again.");
}

Answer<S3MeshStore::Fetched> S3MeshStore::fetch(const std::string& digest, S3Patience patience, bool again) {
  if (again) cache_.drop(digest);
  const int cached = cache_.open(digest);
  // With a copy here there is no need to wait for the bucket.
  const auto seen = look_at(digest, cached >= 0 ? settings_.for_clients : patience);
  const bool is_gone = seen && seen->copies.empty();
  if (cached >= 0 && !is_gone) {
    if (seen) [[maybe_unused]]
      const auto noted = note(folder_of(digest) + "used", settings_.for_clients);
    return Fetched{cached, static_cast<std::int64_t>(::lseek(cached, 0, SEEK_END))};
  }
  if (cached >= 0) ::close(cached);
  if (!seen) return tl::unexpected(seen.error());
  if (is_gone) return mesh_not_found(digest);
  // A copy that somebody is about to delete is as good for reading.
  if (const auto noted = note(folder_of(digest) + "used", patience); !noted) return tl::unexpected(noted.error());
  Answer<Fetched> fetched = mesh_not_found(digest);
  for (const Copy& copy : seen->copies)
    if (fetched = download(digest, copy, patience); fetched || fetched.error().code == Failure::Code::Unavailable)
      break;
  return fetched;
}

template <class Opened>
Answer<Opened> S3MeshStore::open_with(const std::string& digest, S3Patience patience,
                                      const std::function<Opened(Fetched)>& load) {
  if (!is_sha256(digest)) return mesh_not_found(digest);
  for (const bool again : {false, true}) {
    const auto fetched = fetch(digest, patience, again);
    if (!fetched) return tl::unexpected(fetched.error());
    if (Opened opened = load(*fetched); opened != nullptr) return opened;
    if (errno == ENOSPC || errno == EDQUOT)
      return store_full("The server's disk has no room to open the mesh " + digest);
  }
  return internal_failure("The mesh " + digest + " cannot be read from this server's disk; try again.");
}

Answer<std::shared_ptr<const Blob>> S3MeshStore::open(const std::string& digest) {
  return open_with<std::shared_ptr<const Blob>>(digest, settings_.for_jobs, [&](Fetched fetched) {
    return load_file(fetched.file, Form::Plain, {digest, fetched.size}, cache_.directory());
  });
}

Answer<std::unique_ptr<BlobReader>> S3MeshStore::read(const std::string& digest) {
  return open_with<std::unique_ptr<BlobReader>>(digest, settings_.for_clients, [&](Fetched fetched) {
    return read_file(fetched.file, Form::Plain, {digest, fetched.size});
  });
}

// ===== use, owners and removal =====

bool S3MeshStore::touch(const std::string& digest) {
  const auto used = use(digest, settings_.for_clients);
  return used && *used;
}

bool S3MeshStore::pin(const std::string& digest) {
  const auto pinned = pin_and_measure(digest, "");
  return pinned && *pinned;
}

Answer<std::optional<std::int64_t>> S3MeshStore::pin_and_measure(const std::string& digest, const std::string& owner) {
  using Result = std::optional<std::int64_t>;
  if (!is_sha256(digest)) return Result();
  const auto seen = look_at(digest, settings_.for_clients);
  if (!seen) return tl::unexpected(seen.error());
  const bool belongs = owner.empty() || seen->owners.contains(mark_of(digest, owner));
  if (seen->good() == nullptr || !belongs) return Result();
  if (const auto noted = note(folder_of(digest) + "kept", settings_.for_clients); !noted)
    return tl::unexpected(noted.error());
  return use(digest, settings_.for_clients);
}

bool S3MeshStore::belongs_to(const std::string& digest, const std::string& owner) {
  if (!is_sha256(digest)) return false;
  const auto seen = look_at(digest, settings_.for_clients);
  return seen && !seen->copies.empty() && (owner.empty() || seen->owners.contains(mark_of(digest, owner)));
}

void S3MeshStore::grant(const std::string& digest, const std::string& owner) {
  if (owner.empty() || !is_sha256(digest)) return;
  // A worker grants what it has just stored.
  if (const auto noted = note(folder_of(digest) + "o-" + mark_of(digest, owner), settings_.for_jobs); !noted)
    settings_.meshes.log("The owner of the mesh " + digest + " cannot be noted: " + noted.error().sentence);
}

Answer<void> S3MeshStore::remove(const std::string& digest, const std::string& owner) {
  if (!is_sha256(digest)) return mesh_not_found(digest);
  const auto seen = look_at(digest, settings_.for_clients);
  if (!seen) return tl::unexpected(seen.error());
  const std::string mark = mark_of(digest, owner);
  if (seen->copies.empty() || (!owner.empty() && !seen->owners.contains(mark))) return mesh_not_found(digest);
  const auto needed = needed_({digest});
  if (!needed) return tl::unexpected(needed.error());
  if (owner.empty() && !needed->empty()) return mesh_in_use(digest);
  if (!owner.empty()) {
    if (const auto removed = client_->remove(folder_of(digest) + "o-" + mark, settings_.for_clients); !removed)
      return tl::unexpected(removed.error());
    if (!needed->empty() || seen->owners.size() > 1) return {};
  }
  const auto removed = try_remove(digest, seen->used);
  if (!removed) return tl::unexpected(removed.error());
  if (!*removed && owner.empty()) return mesh_in_use(digest);
  return {};
}

}  // namespace varimesh::server
