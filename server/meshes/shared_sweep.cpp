// Deletes what nobody needs from the shared directory. One server at a time does so, the one that has locked the file
// `sweeper`; if it ends, another one takes its place. Nothing would be lost if two did.
//
// The sweeper deletes a file only if it has seen it unchanged for ten minutes of its own steady clock. A use changes a
// file's time. So no mesh is lost that a job needs, whatever the clocks of the servers say, and also if another server
// is just storing that job. Checkpoints that were replaced would fill the disk in ten minutes. So the server that wrote
// them deletes them after one minute, if no job has them and nobody has used them since.
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <system_error>
#include <tuple>
#include <vector>

#include "core/base/sha256.h"
#include "server/meshes/shared_mesh_store.h"

namespace varimesh::server {
namespace {

/// How long after a result was stored the database is asked whether a job has it.
constexpr std::chrono::minutes kAskAfter{10};
/// How long after a server has released a result of its own, such as a checkpoint that another one replaces, it is
/// deleted. An equal job may just have stored the same bytes, and is about to say so.
constexpr std::chrono::minutes kRemoveAfter{1};

}  // namespace

SharedMeshStore::~SharedMeshStore() {
  if (sweeper_ >= 0) ::close(sweeper_);
}

void SharedMeshStore::look() {
  const auto now = settings_.clock();
  const auto oldest = settings_.lifetime - std::min<std::chrono::minutes>(settings_.lifetime, std::chrono::hours(1));
  const auto today = std::chrono::system_clock::now().time_since_epoch();
  std::map<std::string, Seen> found;
  std::error_code error;
  for (std::filesystem::directory_iterator at(directory_, error), end; !error && at != end; at.increment(error)) {
    const auto& file = *at;
    struct stat status {};
    if (::lstat(file.path().c_str(), &status) != 0 || !S_ISREG(status.st_mode)) continue;
    Seen seen{status.st_size, time_of_change(status), now};
    const auto known = seen_.find(file.path().filename().string());
    if (known != seen_.end() && known->second.size == seen.size && known->second.changed == seen.changed) {
      seen.first = known->second.first;
      seen.age_before = known->second.age_before;
    } else if (known == seen_.end()) {
      using Age = std::chrono::steady_clock::duration;
      const auto age = std::chrono::duration_cast<Age>(today - std::chrono::nanoseconds(seen.changed));
      seen.age_before = std::clamp<Age>(age, Age::zero(), oldest);
    }
    found.emplace(file.path().filename().string(), seen);
  }
  if (!error) seen_ = std::move(found);
}

bool SharedMeshStore::rests(const std::string& name) const {
  const auto seen = seen_.find(name);
  return seen != seen_.end() && settings_.clock() - seen->second.first >= kUploadLifetime;
}

void SharedMeshStore::sweep() {
  std::lock_guard lock(sweeping_);
  use_fresh();
  remove_released();
  if (!is_sweeper()) return;
  look();
  sweep_meshes();
  sweep_others();
}

bool SharedMeshStore::is_sweeper() {
  if (sweeper_ < 0)
    sweeper_ = ::open((directory_ / "sweeper").c_str(), O_CREAT | O_RDWR | O_CLOEXEC | O_NOFOLLOW, 0600);
  return sweeper_ >= 0 && ::flock(sweeper_, LOCK_EX | LOCK_NB) == 0;
}

void SharedMeshStore::use_fresh() {
  std::map<std::string, std::chrono::steady_clock::time_point> waiting;
  {
    std::lock_guard lock(mutex_);
    waiting = fresh_;
  }
  const auto now = settings_.clock();
  Digests old;
  for (const auto& [digest, stored] : waiting)
    if (now - stored >= kAskAfter) old.insert(digest);
  const Answer<Digests> needed = old.empty() ? Digests() : needed_(old);
  for (const auto& [digest, stored] : waiting) {
    const bool is_known = needed && needed->contains(digest);
    if (!is_known && touch(digest)) continue;
    std::lock_guard lock(mutex_);
    fresh_.erase(digest);
  }
}

void SharedMeshStore::remove_released() {
  std::map<std::string, Released> ripe;
  {
    std::lock_guard lock(mutex_);
    const auto now = settings_.clock();
    std::erase_if(released_, [&](const auto& one) {
      const bool is_ripe = now - one.second.when >= kRemoveAfter;
      if (is_ripe) ripe.insert(one);
      return is_ripe;
    });
  }
  if (ripe.empty()) return;
  Digests digests;
  for (const auto& [digest, released] : ripe) digests.insert(digest);
  const auto needed = needed_(digests);
  if (!needed) return;  // the sweeper deletes them later
  for (const auto& [digest, released] : ripe) {
    struct stat kept {};
    if (needed->contains(digest) || ::lstat(kept_of(digest).c_str(), &kept) == 0) continue;
    remove_file(digest, [&](const struct stat& now) { return time_of_change(now) == released.changed; });
  }
}

void SharedMeshStore::sweep_meshes() {
  std::int64_t total = 0;
  Digests resting;
  for (const auto& [name, seen] : seen_) {
    if (!is_sha256(name)) continue;
    total += seen.size;
    if (rests(name)) resting.insert(name);
  }
  stored_ = total;
  // Asked after the look: a job that is stored from now on has used its mesh since, or less than ten minutes before.
  const auto needed = needed_(resting);
  if (!needed) return;  // nobody knows what is needed
  std::vector<std::tuple<std::int64_t, std::string, const Seen*>> idle;
  for (const std::string& name : resting)
    if (!needed->contains(name)) idle.emplace_back(seen_.at(name).changed, name, &seen_.at(name));
  std::sort(idle.begin(), idle.end());
  for (const auto& [changed, name, seen] : idle) {
    const bool is_kept = seen_.contains(name + ".kept");
    const auto age = settings_.clock() - seen->first + seen->age_before;
    const bool too_old = !is_kept || age >= settings_.lifetime;
    const bool too_much = settings_.max_total_bytes > 0 && total > settings_.max_total_bytes;
    if (!too_old && !too_much) continue;
    // Somebody may use it at this moment.
    if (remove_file(name, [changed = changed](const struct stat& now) { return time_of_change(now) == changed; }))
      total -= seen->size;
  }
  stored_ = total;
}

void SharedMeshStore::sweep_others() {
  for (const auto& [name, seen] : seen_) {
    if (!rests(name)) continue;
    const std::string stem = name.substr(0, name.find('.'));
    if (name.starts_with("upload-") && stem != name && (rests(stem) || !seen_.contains(stem))) drop_upload(stem);
    const bool is_lone_upload = name.starts_with("upload-") && !seen_.contains(stem + ".about");
    const std::string ending = name.substr(stem.size());  // other files are not of this store
    const bool is_note = ending == ".kept" || (!ending.empty() && is_sha256(ending.substr(1)));
    const bool is_of_no_mesh = is_note && is_sha256(stem) && !size_of(stem);
    if (is_lone_upload || is_of_no_mesh || name.starts_with("part-")) ::unlink((directory_ / name).c_str());
  }
}

}  // namespace varimesh::server
