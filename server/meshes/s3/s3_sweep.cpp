// Deletes what nobody needs from the bucket. One server looks through the bucket every five minutes; if it ends,
// another one takes its place. Nothing would be lost if two did: the header says why.
//
// The sweeper deletes a mesh only if it has seen it unused for ten minutes of its own steady clock. Checkpoints that
// were replaced are deleted after one minute by the server that wrote them.
#include <algorithm>
#include <tuple>

#include "core/base/sha256.h"
#include "server/meshes/s3/s3_mesh_store.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

using std::chrono::minutes;

constexpr minutes kLookEvery{5}, kRemoveAfter{1}, kAskAfter{10};
/// A sweeper that has not been seen at work for this long has ended.
constexpr minutes kSweeperLost{12};
constexpr char kSweeper[] = "sweeper";

/// Sweeping is not urgent.
constexpr S3Patience kPatience{10'000};

}  // namespace

struct S3MeshStore::Mesh {
  std::int64_t bytes = 0, changed = 0;
  std::string used;
  bool has_copies = false, kept = false, rests = true;
  std::chrono::steady_clock::duration age = std::chrono::steady_clock::duration::max();
};

Answer<bool> S3MeshStore::try_remove(const std::string& digest, const std::string& used) {
  const std::string folder = folder_of(digest), name = random_digits();
  const auto before = look_at(digest, kPatience);
  if (!before) return tl::unexpected(before.error());
  for (const Copy& copy : before->copies)
    if (const auto marked = note(folder + "x-" + copy.name + "-" + name, kPatience); !marked)
      return tl::unexpected(marked.error());
  // Nobody who looks from now on takes these copies for good; whoever has looked before has written `used` before.
  const auto now = look_at(digest, kPatience);
  const auto needed = now ? needed_({digest}) : tl::unexpected(now.error());
  const bool may_go = now && needed && now->used == used && needed->empty();
  Answer<void> done;
  for (const Copy& copy : before->copies) {
    if (may_go) done = client_->remove(folder + "g-" + copy.name, kPatience);
    if (!done) return tl::unexpected(done.error());  // its mark stays, and another sweep deletes it
    done = client_->remove(folder + "x-" + copy.name + "-" + name, kPatience);
    for (const std::string& mark : before->marks)
      if (may_go && mark.starts_with(copy.name + "-")) done = client_->remove(folder + "x-" + mark, kPatience);
  }
  if (may_go) cache_.drop(digest);
  if (!needed) return tl::unexpected(needed.error());
  return may_go;
}

void S3MeshStore::sweep() {
  std::lock_guard lock(sweeping_);
  drop_idle_uploads();
  use_fresh();
  remove_released();
  const auto now = settings_.meshes.clock();
  if (looked_ && now - *looked_ < kLookEvery) return;
  looked_ = now;
  if (!is_sweeper() || !look()) return;
  sweep_meshes();
  sweep_others();
}

bool S3MeshStore::is_sweeper() {
  const auto now = settings_.meshes.clock();
  const auto found = client_->get_small(kSweeper, kPatience);
  if (!found && found.error().code != Failure::Code::NotFound) return false;
  const std::string text = found.value_or("");
  if (text != sweeper_) {
    sweeps_ = false;  // another server is at work
    sweeper_changed_ = now;
    sweeper_ = text;
  }
  sweeps_ = sweeps_ || text.empty() || now - sweeper_changed_ >= kSweeperLost;
  if (!sweeps_) return false;
  sweeper_ = random_digits();
  sweeper_changed_ = now;
  return client_->put(kSweeper, sweeper_, kPatience).has_value();
}

Answer<void> S3MeshStore::look() {
  using Age = std::chrono::steady_clock::duration;
  const auto now = settings_.meshes.clock();
  const auto oldest = settings_.meshes.lifetime - std::min<minutes>(settings_.meshes.lifetime, minutes(60));
  const auto today = std::chrono::system_clock::now().time_since_epoch();
  std::map<std::string, Resting> found;
  for (const char* const folder : {"meshes/", "uploads/"}) {
    auto objects = client_->list(folder, kPatience);
    if (!objects) return tl::unexpected(objects.error());
    for (S3Object& object : *objects) {
      const auto known = seen_.find(object.key);
      Resting resting{std::move(object), now};
      if (known != seen_.end() && known->second.object.tag == resting.object.tag &&
          known->second.object.size == resting.object.size) {
        resting.first = known->second.first;
        resting.age_before = known->second.age_before;
      } else if (known == seen_.end()) {
        const auto age = std::chrono::duration_cast<Age>(today - std::chrono::nanoseconds(resting.object.changed));
        resting.age_before = std::clamp<Age>(age, Age::zero(), oldest);
      }
      found.emplace(resting.object.key, std::move(resting));
    }
  }
  seen_ = std::move(found);
  return {};
}

bool S3MeshStore::rests(const std::string& key) const {
  const auto found = seen_.find(key);
  return found == seen_.end() || settings_.meshes.clock() - found->second.first >= kUploadLifetime;
}

std::map<std::string, S3MeshStore::Mesh> S3MeshStore::meshes_seen() const {
  constexpr std::size_t kFolder = sizeof("meshes/") - 1, kDigest = 64;
  std::map<std::string, Mesh> all;
  for (auto at = seen_.lower_bound("meshes/"); at != seen_.end() && at->first.starts_with("meshes/"); ++at) {
    const auto& [key, resting] = *at;
    const std::string digest = key.substr(kFolder, kDigest);
    if (!is_sha256(digest) || key.size() < kFolder + kDigest + 2) continue;  // not of this store
    const std::string name = key.substr(kFolder + kDigest + 1);
    Mesh& mesh = all[digest];
    mesh.rests = mesh.rests && rests(key);
    mesh.kept = mesh.kept || name == "kept";
    if (name.starts_with("g-")) {
      mesh.has_copies = true;
      mesh.bytes += resting.object.size;
    }
    if (name == "used") mesh.used = resting.object.tag;
    if (name != "used" && !name.starts_with("g-")) continue;
    mesh.age = std::min(mesh.age, settings_.meshes.clock() - resting.first + resting.age_before);
    mesh.changed = std::max(mesh.changed, resting.object.changed);
  }
  return all;
}

void S3MeshStore::use_fresh() {
  std::map<std::string, Stored> waiting;
  {
    std::lock_guard lock(mutex_);
    waiting = fresh_;
  }
  const auto now = settings_.meshes.clock();
  Digests old;
  for (const auto& [digest, stored] : waiting)
    if (now - stored.when >= kAskAfter) old.insert(digest);
  if (old.empty()) return;
  const auto needed = needed_(old);
  for (const std::string& digest : old) {
    const bool is_known = needed && needed->contains(digest);
    // The job cannot be told of it yet. Five minutes later this is asked again.
    const auto tag =
        is_known ? Answer<std::string>("") : client_->put(folder_of(digest) + "used", random_digits(), kPatience);
    std::lock_guard lock(mutex_);
    const auto found = fresh_.find(digest);
    if (found == fresh_.end()) continue;
    if (is_known)
      fresh_.erase(found);
    else if (tag)
      found->second = {now - kAskAfter / 2, *tag};
  }
}

void S3MeshStore::remove_released() {
  std::map<std::string, Stored> ripe;
  {
    std::lock_guard lock(mutex_);
    const auto now = settings_.meshes.clock();
    std::erase_if(released_, [&](const auto& one) {
      const bool is_ripe = now - one.second.when >= kRemoveAfter;
      if (is_ripe) ripe.insert(one);
      return is_ripe;
    });
  }
  for (const auto& [digest, released] : ripe) {
    const auto kept = client_->list(folder_of(digest) + "kept", kPatience);
    if (!kept || !kept->empty()) continue;
    [[maybe_unused]] const auto removed = try_remove(digest, released.used);  // otherwise the sweeper does, later
  }
}

void S3MeshStore::sweep_meshes() {
  const auto meshes = meshes_seen();
  std::int64_t total = 0;
  Digests resting;
  for (const auto& [digest, mesh] : meshes) {
    total += mesh.bytes;
    if (mesh.has_copies && mesh.rests) resting.insert(digest);
  }
  const std::int64_t most = settings_.meshes.max_total_bytes;
  const auto needed = needed_(resting);
  if (needed) {
    std::vector<std::tuple<std::int64_t, std::string, const Mesh*>> idle;
    for (const std::string& digest : resting)
      if (!needed->contains(digest)) idle.emplace_back(meshes.at(digest).changed, digest, &meshes.at(digest));
    std::sort(idle.begin(), idle.end());
    for (const auto& [changed, digest, mesh] : idle) {
      const bool too_old = !mesh->kept || mesh->age >= settings_.meshes.lifetime;
      const bool too_much = most > 0 && total > most;
      if (!too_old && !too_much) continue;
      const auto removed = try_remove(digest, mesh->used);
      if (removed && *removed) total -= mesh->bytes;
    }
  }
  stored_ = total;
}

void S3MeshStore::sweep_others() {
  const auto meshes = meshes_seen();
  std::map<std::string, bool> upload_rests;
  constexpr std::size_t kUploadKey = sizeof("uploads/") - 1 + 64;
  for (const auto& [key, resting] : seen_) {
    if (!key.starts_with("uploads/")) continue;
    const auto [at, is_new] = upload_rests.try_emplace(key.substr(0, kUploadKey), true);
    at->second = at->second && rests(key);
  }
  for (const auto& [key, resting] : seen_) {
    const auto upload = upload_rests.find(key.substr(0, kUploadKey));
    const auto mesh = key.starts_with("meshes/") ? meshes.find(key.substr(7, 64)) : meshes.end();
    const bool is_dead_upload = upload != upload_rests.end() && upload->second;
    // What was noted of a mesh that is gone. A new copy that is just stored changes `used`.
    const bool is_of_no_mesh = mesh != meshes.end() && !mesh->second.has_copies && mesh->second.rests;
    if (is_dead_upload || is_of_no_mesh) [[maybe_unused]]
      const auto removed = client_->remove(key, kPatience);
  }
}

}  // namespace varimesh::server
