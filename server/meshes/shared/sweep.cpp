// Deletes what nobody needs. One server at a time does so; if it ends, another one takes its place.
//
// The sweeper deletes a mesh only if it has seen it unused for ten minutes of its own steady clock. A use changes a
// mesh's tag. So no mesh is lost that a job needs, whatever the clocks of the servers say, and also if another server
// is just storing that job. Checkpoints that were replaced would fill the place in ten minutes. So the server that
// wrote them deletes them after one minute, if no job has them and nobody has used them since.
#include <algorithm>
#include <tuple>
#include <vector>

#include "core/base/sha256.h"
#include "server/meshes/shared/shared_mesh_store.h"

namespace varimesh::server {
namespace {

using std::chrono::minutes;

/// How long after a result was stored the database is asked whether a job has it. Until it has, the result is used
/// again and again, more often than the sweepers delete.
constexpr minutes kAskAfter{4};
/// How long after a server has released a result of its own, such as a checkpoint that another one replaces, it is
/// deleted. An equal job may just have stored the same bytes, and is about to say so.
constexpr minutes kRemoveAfter{1};

/// Sweeping is not urgent.
constexpr Patience kPatience{10'000};

}  // namespace

bool SharedMeshStore::look() {
  using Age = std::chrono::steady_clock::duration;
  auto objects = objects_->list({}, kPatience);
  if (!objects) return false;
  const auto now = settings_.meshes.clock();
  const minutes lifetime = settings_.meshes.lifetime;
  const auto oldest = lifetime - std::min<minutes>(lifetime, std::chrono::hours(1));
  const auto today = std::chrono::system_clock::now().time_since_epoch();
  std::map<std::string, Resting> found;
  for (Object& object : *objects) {
    const auto known = seen_.find(object.name);
    Resting seen{std::move(object), now};
    if (known != seen_.end() && known->second.object.size == seen.object.size &&
        known->second.object.tag == seen.object.tag) {
      seen.first = known->second.first;
      seen.age_before = known->second.age_before;
    } else if (known == seen_.end()) {
      const auto age = std::chrono::duration_cast<Age>(today - std::chrono::nanoseconds(seen.object.changed));
      seen.age_before = std::clamp<Age>(age, Age::zero(), oldest);
    }
    found.emplace(seen.object.name, std::move(seen));
  }
  seen_ = std::move(found);
  return true;
}

bool SharedMeshStore::rests(const Resting& seen) const {
  return settings_.meshes.clock() - seen.first >= kUploadLifetime;
}

void SharedMeshStore::sweep() {
  std::lock_guard lock(sweeping_);
  drop_idle_uploads();
  use_fresh();
  remove_released();
  if (!objects_->may_sweep(settings_.meshes.clock()) || !look()) return;
  sweep_meshes();
  sweep_others();
}

void SharedMeshStore::use_fresh() {
  const auto now = settings_.meshes.clock();
  Digests old;
  {
    std::lock_guard lock(mutex_);
    for (const auto& [digest, stored] : fresh_)
      if (now - stored.when >= kAskAfter) old.insert(digest);
  }
  if (old.empty()) return;
  const auto needed = needed_(old);
  for (const std::string& digest : old) {
    Answer<std::optional<Object>> used = std::optional<Object>();
    bool is_done = needed && needed->contains(digest);
    if (!is_done) {
      used = objects_->use(digest, kPatience);
      const auto found = used && !*used ? objects_->find(digest, kPatience) : used;
      is_done = found && !*found;
    }
    std::lock_guard lock(mutex_);
    const auto found = fresh_.find(digest);
    if (found == fresh_.end()) continue;
    if (is_done)
      fresh_.erase(found);
    else if (used)
      found->second = {now, *used ? (*used)->tag : found->second.tag};
  }
}

void SharedMeshStore::remove_released() {
  std::map<std::string, Stored> ripe;
  Digests digests;
  {
    std::lock_guard lock(mutex_);
    const auto now = settings_.meshes.clock();
    std::erase_if(released_, [&](const auto& one) {
      const bool is_ripe = now - one.second.when >= kRemoveAfter;
      if (is_ripe) ripe.insert(one), digests.insert(one.first);
      return is_ripe;
    });
  }
  if (ripe.empty()) return;
  const auto needed = needed_(digests);
  if (!needed) return;  // the sweeper deletes them later
  for (const auto& [digest, released] : ripe) {
    if (needed->contains(digest)) continue;
    const auto kept = objects_->find(digest + ".kept", kPatience);
    if (!kept || *kept) continue;
    [[maybe_unused]] const auto removed =
        objects_->remove_unused(digest, released.tag, unless_needed(digest), kPatience);
  }
}

void SharedMeshStore::sweep_meshes() {
  std::int64_t total = 0;
  Digests resting;
  for (const auto& [name, seen] : seen_) {
    if (!is_sha256(name)) continue;
    total += seen.object.size;
    if (rests(seen)) resting.insert(name);
  }
  stored_ = total;
  // Asked after the look: a job that is stored from now on has used its mesh since, or less than ten minutes before.
  const auto needed = needed_(resting);
  if (!needed) return;  // nobody knows what is needed
  std::vector<std::tuple<std::int64_t, std::string, const Resting*>> idle;
  for (const std::string& name : resting)
    if (!needed->contains(name)) idle.emplace_back(seen_.at(name).object.changed, name, &seen_.at(name));
  std::sort(idle.begin(), idle.end());
  for (const auto& [changed, name, seen] : idle) {
    const auto age = settings_.meshes.clock() - seen->first + seen->age_before;
    const bool too_old = !seen_.contains(name + ".kept") || age >= settings_.meshes.lifetime;
    const bool too_much = settings_.meshes.max_total_bytes > 0 && total > settings_.meshes.max_total_bytes;
    if (!too_old && !too_much) continue;
    // Somebody may use it at this moment.
    const auto removed = objects_->remove_unused(name, seen->object.tag, unless_needed(name), kPatience);
    if (removed && *removed) total -= seen->object.size;
  }
  stored_ = total;
}

void SharedMeshStore::sweep_others() {
  std::map<std::string, bool> uploads;  // whether all of it rests
  for (const auto& [name, seen] : seen_) {
    const std::string stem = name.substr(0, name.find('.'));
    if (name.starts_with("upload-")) {
      const auto [upload, is_new] = uploads.try_emplace(stem, true);
      upload->second = upload->second && rests(seen);
    } else if (name != stem && is_sha256(stem) && !seen_.contains(stem) && rests(seen) && !has(stem)) {
      // What was noted of a mesh that is gone.
      [[maybe_unused]] const auto removed = objects_->remove(name, kPatience);
    } else if (name.starts_with("part-") && rests(seen)) {
      [[maybe_unused]] const auto removed = objects_->remove(name, kPatience);
    }
  }
  for (const auto& [key, all_rests] : uploads) {
    if (!all_rests) continue;
    const auto held = objects_->hold(key, false);
    const auto seen = seen_.find(key + ".about");
    const auto now = objects_->find(key + ".about", kPatience);
    const std::string before = seen == seen_.end() ? "" : seen->second.object.tag;
    if (now && (*now ? (*now)->tag : "") == before) [[maybe_unused]]
      const auto removed = objects_->remove_upload(key, kPatience);
  }
}

}  // namespace varimesh::server
