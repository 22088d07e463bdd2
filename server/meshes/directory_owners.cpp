// Whose a mesh is. The owners of uploads are in a file beside the mesh, DIGEST.owners.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <system_error>
#include <utility>
#include <vector>

#include "core/base/io/write_all.h"
#include "core/base/sha256.h"
#include "server/meshes/directory_mesh_store.h"
#include "server/meshes/directory_upload.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

/// For how long an owner who has too much is not counted again, since that looks at every mesh.
constexpr std::chrono::seconds kShareLifetime{1};

}  // namespace

bool DirectoryMeshStore::belongs(const Entries::value_type& entry, const std::string& owner) {
  if (owner.empty()) return true;
  const std::string mark = mark_of(entry.first, owner);
  return entry.second.owners.contains(mark) || entry.second.by_jobs.contains(mark);
}

bool DirectoryMeshStore::belongs_to(const std::string& digest, const std::string& owner) {
  std::lock_guard lock(mutex_);
  const auto entry = find_stored(digest);
  return entry != entries_.end() && belongs(*entry, owner);
}

void DirectoryMeshStore::grant(const std::string& digest, const std::string& owner) {
  std::lock_guard lock(mutex_);
  grant_locked(digest, owner);
}

void DirectoryMeshStore::grant_locked(const std::string& digest, const std::string& owner) {
  const auto entry = entries_.find(digest);
  if (owner.empty() || entry == entries_.end()) return;
  const bool has_it = belongs(*entry, owner);
  entry->second.by_jobs.insert(mark_of(digest, owner));
  if (!has_it) add_to_share(owner, entry->second.size);
}

void DirectoryMeshStore::revoke(const std::string& digest, const std::string& owner) {
  std::lock_guard lock(mutex_);
  if (const auto entry = entries_.find(digest); entry != entries_.end())
    entry->second.by_jobs.erase(mark_of(digest, owner));
}

std::int64_t DirectoryMeshStore::count_share(const std::string& owner) const {
  std::int64_t bytes = 0;
  for (const auto& entry : entries_)
    if (!(entry.second.owners.empty() && entry.second.by_jobs.empty()) && belongs(entry, owner))
      bytes += entry.second.size;
  for (const auto& [key, upload] : uploads_)
    if (key.first == owner) bytes += upload->size;
  return bytes;
}

void DirectoryMeshStore::add_to_share(const std::string& owner, std::int64_t bytes) {
  if (const auto share = shares_.find(owner); share != shares_.end()) share->second.bytes += bytes;
}

Answer<void> DirectoryMeshStore::check_share_locked(const std::string& owner, std::int64_t more) {
  const std::int64_t most = settings_.max_bytes_of_owner;
  if (most == 0 || owner.empty()) return {};
  const auto now = settings_.clock();
  const auto [found, is_new] = shares_.try_emplace(owner);
  Share& share = found->second;
  const auto kept = kept_.find(owner);
  const std::int64_t room = most - more - (kept == kept_.end() ? 0 : kept->second);
  if (is_new || (share.bytes > room && now - share.counted >= kShareLifetime)) share = {count_share(owner), now};
  if (share.bytes <= room) return {};
  return owner_full(owner, most - more - room + share.bytes, most);
}

std::optional<std::int64_t> DirectoryMeshStore::share_of(const std::string& owner) {
  if (settings_.max_bytes_of_owner == 0 || owner.empty()) return {};
  std::lock_guard lock(mutex_);
  const auto now = settings_.clock();
  const auto [found, is_new] = shares_.try_emplace(owner);
  if (is_new || now - found->second.counted >= kShareLifetime) found->second = {count_share(owner), now};
  const auto kept = kept_.find(owner);
  return found->second.bytes + (kept == kept_.end() ? 0 : kept->second);
}

Answer<void> DirectoryMeshStore::check_share(const std::string& owner, std::int64_t more) {
  std::lock_guard lock(mutex_);
  return check_share_locked(owner, more);
}

/// Bytes of an owner that no mesh of the store has yet.
class DirectoryMeshStore::KeptBytes : public KeptShare {
 public:
  KeptBytes(DirectoryMeshStore& store, std::string owner) : store_(&store), owner_(std::move(owner)) {}
  ~KeptBytes() override {
    std::lock_guard lock(store_->mutex_);
    give_back();
  }
  Answer<void> raise_to(std::int64_t bytes) override {
    std::lock_guard lock(store_->mutex_);
    const std::int64_t more = std::max<std::int64_t>(bytes - bytes_, 0);
    if (const auto room = store_->check_share_locked(owner_, more); !room) return room;
    bytes_ += more;
    store_->kept_[owner_] += more;
    return {};
  }
  void grant(const std::string& digest) override {
    std::lock_guard lock(store_->mutex_);
    store_->grant_locked(digest, owner_);
    give_back();
  }

 private:
  /// Requires the lock of the store.
  void give_back() {
    const auto kept = store_->kept_.find(owner_);
    if (kept == store_->kept_.end()) return;
    kept->second -= std::exchange(bytes_, 0);
    if (kept->second == 0) store_->kept_.erase(kept);
  }

  DirectoryMeshStore* const store_;
  const std::string owner_;
  std::int64_t bytes_ = 0;
};

std::unique_ptr<KeptShare> DirectoryMeshStore::keep_share(const std::string& owner) {
  if (settings_.max_bytes_of_owner == 0 || owner.empty()) return nullptr;
  return std::make_unique<KeptBytes>(*this, owner);
}

Answer<void> DirectoryMeshStore::grant_for_good(const std::string& digest, const std::string& owner) {
  if (owner.empty()) return {};
  {
    std::lock_guard lock(mutex_);
    const auto entry = entries_.find(digest);
    if (entry == entries_.end()) return upload_not_found("The mesh was deleted while it was uploaded");
    entry->second.owners.insert(mark_of(digest, owner));
    if (durable_ && !write_owners(*entry)) return cannot_store("the file of its owners cannot be written");
  }
  if (durable_ && !sync_directory(directory_)) return cannot_store("a directory cannot be written to the disk");
  return {};
}

Answer<void> DirectoryMeshStore::remove(const std::string& digest, const std::string& owner) {
  std::lock_guard lock(mutex_);
  const auto entry = find_stored(digest);
  if (entry == entries_.end() || !belongs(*entry, owner)) return mesh_not_found(digest);
  if (owner.empty() && entry->second.references > 0) return mesh_in_use(digest);
  Entry& mesh = entry->second;
  for (std::set<std::string>* marks : {&mesh.owners, &mesh.by_jobs}) marks->erase(mark_of(digest, owner));
  if (owner.empty() || (mesh.references == 0 && mesh.owners.empty() && mesh.by_jobs.empty())) {
    drop(entry);
    return {};
  }
  if (durable_ && !write_owners(*entry)) return cannot_store("the file of its owners cannot be written");
  return {};
}

bool DirectoryMeshStore::write_owners(const Entries::value_type& entry) {
  if (entry.second.owners.empty()) return ::unlink(owners_of(entry.first).c_str()) == 0 || errno == ENOENT;
  const std::filesystem::path path = directory_ / ("part-" + std::to_string(++counter_));
  const int file = ::open(path.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (file < 0) return false;
  std::string text;
  for (const std::string& mark : entry.second.owners) text += mark + "\n";
  const bool written = write_all(file, text) && ::fdatasync(file) == 0;
  int reason = errno;
  ::close(file);
  std::error_code error;
  if (written) {
    std::filesystem::rename(path, owners_of(entry.first), error);
    if (!error) return true;
    reason = error.value();
  }
  std::filesystem::remove(path, error);
  errno = reason;
  return false;
}

void DirectoryMeshStore::read_owners() {
  std::error_code ignored;
  std::vector<std::filesystem::path> stale;
  for (const auto& file : std::filesystem::directory_iterator(directory_, ignored)) {
    if (file.symlink_status(ignored).type() != std::filesystem::file_type::regular) continue;
    if (file.path().extension() != ".owners") continue;
    const auto entry = entries_.find(file.path().stem().string());
    if (entry == entries_.end()) {
      stale.push_back(file.path());
      continue;
    }
    std::ifstream lines(file.path());
    for (std::string mark; std::getline(lines, mark);)
      if (is_sha256(mark)) entry->second.owners.insert(mark);
  }
  for (const std::filesystem::path& path : stale) std::filesystem::remove(path, ignored);
}

}  // namespace varimesh::server
