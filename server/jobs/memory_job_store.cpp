// The job store in memory.
#include "server/jobs/memory_job_store.h"

#include <algorithm>

#include "server/jobs/timestamps.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

bool is_running(v1::JobState state) { return state == v1::JOB_STATE_RUNNING || state == v1::JOB_STATE_CANCELLING; }

void count(std::map<std::string, int>& counts, const std::string& peer, int change) {
  const auto entry = counts.try_emplace(peer).first;
  if ((entry->second += change) == 0) counts.erase(entry);
}

int count_of(const std::map<std::string, int>& counts, const std::string& peer) {
  const auto found = counts.find(peer);
  return found == counts.end() ? 0 : found->second;
}

}  // namespace

Answer<MemoryJobStore::Entries::iterator> MemoryJobStore::find(const std::string& name) {
  const auto found = by_name_.find(name);
  if (found == by_name_.end()) return job_not_found(name);
  return entries_.find(found->second);
}

Answer<MemoryJobStore::Entries::iterator> MemoryJobStore::find(const Claim& claim) {
  const auto entry = find(claim.name);
  if (!entry) return entry;
  if (const auto checked = transitions_.check((*entry)->second.record, claim); !checked)
    return tl::unexpected(checked.error());
  return entry;
}

Changed MemoryJobStore::apply(Entries::iterator entry, v1::JobState before, Changed changed) {
  auto& [key, kept] = *entry;
  const v1::JobState state = kept.record.job.state();
  const std::pair<std::int64_t, std::int64_t> place{turn_of(kept.record.job), key};
  const std::string& peer = kept.record.peer;
  if (before == v1::JOB_STATE_PENDING) {
    const auto queue = pending_.find(peer);
    queue->second.erase(place);
    if (queue->second.empty()) pending_.erase(queue);
    --pending_count_;
  }
  if (state == v1::JOB_STATE_PENDING) pending_[peer].insert(place), ++pending_count_;
  if (is_running(before)) running_.erase(key), count(running_of_, peer, -1);
  if (is_running(state)) running_.insert(key), count(running_of_, peer, 1);
  if (has_ended(state) && !has_ended(before)) ended_[kept.record.job.owner()].push_back(key);
  kept.events.insert(kept.events.end(), changed.events.begin(), changed.events.end());
  return changed;
}

Answer<Changed> MemoryJobStore::submit(const Submission& submission) {
  std::lock_guard lock(mutex_);
  const std::pair request(submission.owner, submission.request_id);
  if (const auto found = by_request_.find(request); found != by_request_.end()) {
    const v1::Job& job = entries_.at(found->second).record.job;
    if (const auto same = check_same(job, submission); !same) return tl::unexpected(same.error());
    return Changed{job, {}, {}};
  }
  const auto queue = pending_.find(submission.peer);
  const int waiting = queue == pending_.end() ? 0 : static_cast<int>(queue->second.size());
  if (is_full(pending_count_, waiting, submission.max_pending)) return queue_full(pending_count_);
  if (submission.max_pending_of_peer > 0 && waiting >= submission.max_pending_of_peer)
    return too_many_waiting(submission.peer, waiting);
  const auto entry = entries_.emplace(++counter_, Entry()).first;
  by_name_[submission.name] = entry->first;
  if (!submission.request_id.empty()) by_request_[request] = entry->first;
  return apply(entry, v1::JOB_STATE_UNSPECIFIED, transitions_.create(entry->second.record, submission));
}

Answer<v1::Job> MemoryJobStore::get(const std::string& name) {
  std::lock_guard lock(mutex_);
  return find(name).map([](const auto& entry) { return entry->second.record.job; });
}

Answer<JobPage> MemoryJobStore::list(const JobFilter& filter, int page_size, const std::string& page_token) {
  // The token is the number of the last job on the previous page. New jobs get larger numbers, so pages do not shift.
  const auto below = parse_page_token(page_token);
  if (!below) return tl::unexpected(below.error());
  std::lock_guard lock(mutex_);
  JobPage page;
  auto entry = std::make_reverse_iterator(*below > 0 ? entries_.lower_bound(*below) : entries_.end());
  std::size_t bytes = 0;
  for (std::int64_t last = 0; entry != entries_.rend(); ++entry) {
    if (!matches(entry->second.record.job, filter)) continue;
    bytes += entry->second.record.job.ByteSizeLong();
    if (static_cast<int>(page.jobs.size()) == page_size || (bytes > filter.most_bytes && !page.jobs.empty())) {
      page.next_page_token = std::to_string(last);
      break;
    }
    page.jobs.push_back(entry->second.record.job);
    last = entry->first;
  }
  return page;
}

Answer<JobCounts> MemoryJobStore::counts() {
  std::lock_guard lock(mutex_);
  return JobCounts{pending_count_, static_cast<int>(running_.size())};
}

Answer<std::optional<TimePoint>> MemoryJobStore::oldest_pending() {
  std::lock_guard lock(mutex_);
  std::optional<TimePoint> oldest;
  for (const auto& [peer, queue] : pending_)
    for (const auto& [turn, key] : queue) {
      const TimePoint time = time_point(entries_.at(key).record.job.create_time());
      if (!oldest || time < *oldest) oldest = time;
    }
  return oldest;
}

Answer<std::vector<v1::JobEvent>> MemoryJobStore::events(const std::string& name) {
  std::lock_guard lock(mutex_);
  return find(name).map([](const auto& entry) { return entry->second.events; });
}

Answer<std::optional<Claimed>> MemoryJobStore::claim(const std::string& worker) {
  std::lock_guard lock(mutex_);
  const int most = transitions_.settings().max_running_of_peer;
  std::map<std::string, int> waiting;
  for (const auto& [peer, queue] : pending_) {
    const int running = count_of(running_of_, peer);
    if (most == 0 || peer.empty() || running < most) waiting[peer] = running;
  }
  const std::string* const next = turns_.next(waiting);
  if (next == nullptr) return std::nullopt;
  turns_.take(*next);
  const auto entry = entries_.find(pending_.at(*next).begin()->second);
  JobRecord& record = entry->second.record;
  Changed changed = apply(entry, v1::JOB_STATE_PENDING, transitions_.claim(record, worker));
  return Claimed{claim_of(record), std::move(changed.events)};
}

Answer<bool> MemoryJobStore::renew_lease(const Claim& claim) {
  std::lock_guard lock(mutex_);
  return find(claim).map([this](const auto& entry) {
    transitions_.renew(entry->second.record);
    return entry->second.record.job.state() == v1::JOB_STATE_CANCELLING;
  });
}

Answer<void> MemoryJobStore::note_progress(const Claim& claim, const v1::Iteration& iteration,
                                           std::int64_t last_sequence) {
  std::lock_guard lock(mutex_);
  return find(claim).map(
      [&](const auto& entry) { transitions_.note_progress(entry->second.record, iteration, last_sequence); });
}

Answer<Changed> MemoryJobStore::note_checkpoint(const Claim& claim, const CheckpointReference& checkpoint) {
  std::lock_guard lock(mutex_);
  return find(claim).map(
      [&](const auto& entry) { return transitions_.note_checkpoint(entry->second.record, checkpoint); });
}

Answer<Changed> MemoryJobStore::finish(const Claim& claim, const Ending& ending, std::int64_t last_sequence) {
  std::lock_guard lock(mutex_);
  return find(claim).map([&](const auto& entry) {
    const v1::JobState before = entry->second.record.job.state();
    return apply(entry, before, transitions_.finish(entry->second.record, ending, last_sequence));
  });
}

Answer<Changed> MemoryJobStore::request_cancel(const std::string& name, std::int64_t last_sequence) {
  std::lock_guard lock(mutex_);
  return find(name).map([&](const auto& entry) {
    const v1::JobState before = entry->second.record.job.state();
    return apply(entry, before, transitions_.cancel(entry->second.record, last_sequence));
  });
}

Answer<std::vector<Changed>> MemoryJobStore::take_back(const std::string& worker,
                                                       const std::set<std::string>& running) {
  std::lock_guard lock(mutex_);
  std::vector<Changed> all;
  const std::vector<std::int64_t> keys(running_.begin(), running_.end());
  for (const std::int64_t key : keys) {
    const auto entry = entries_.find(key);
    if (!transitions_.is_lost(entry->second.record, worker, running)) continue;
    const v1::JobState before = entry->second.record.job.state();
    all.push_back(apply(entry, before, transitions_.take_back(entry->second.record)));
  }
  return all;
}

Answer<std::string> MemoryJobStore::history_digest(const std::string& name) {
  std::lock_guard lock(mutex_);
  return find(name).map([](const auto& entry) { return entry->second.record.history_digest; });
}

Answer<Changed> MemoryJobStore::remove(const std::string& name) {
  std::lock_guard lock(mutex_);
  const auto found = find(name);
  if (!found) return tl::unexpected(found.error());
  const JobRecord& record = (*found)->second.record;
  if (!has_ended(record.job.state())) return job_not_ended(name);
  Changed changed{record.job, {}, digests_of(record)};
  by_name_.erase(name);
  if (!record.job.request_id().empty()) by_request_.erase({record.job.owner(), record.job.request_id()});
  const auto ended = ended_.find(record.job.owner());
  std::erase(ended->second, (*found)->first);
  if (ended->second.empty()) ended_.erase(ended);
  entries_.erase(*found);
  return changed;
}

Answer<std::vector<std::string>> MemoryJobStore::ended_beyond(std::size_t keep, TimePoint before) {
  std::lock_guard lock(mutex_);
  std::vector<std::string> names;
  for (const auto& [owner, ended] : ended_)
    for (std::size_t i = 0; i + keep < ended.size(); ++i) {
      const v1::Job& job = entries_.at(ended[i]).record.job;
      if (time_point(job.end_time()) < before) names.push_back(job.name());
    }
  return names;
}

Answer<std::vector<Reference>> MemoryJobStore::references() {
  std::lock_guard lock(mutex_);
  std::vector<Reference> all;
  for (const auto& [key, entry] : entries_)
    for (std::string& digest : digests_of(entry.record)) all.push_back({std::move(digest), entry.record.job.owner()});
  return all;
}

Answer<std::set<std::string>> MemoryJobStore::needed_digests() {
  std::lock_guard lock(mutex_);
  std::set<std::string> needed;
  for (const auto& [key, entry] : entries_)
    if (!has_ended(entry.record.job.state())) add_needed(entry.record, &needed);
  return needed;
}

}  // namespace varimesh::server
