// Maps under one lock.
#include "server/jobs/memory_job_store.h"

#include <google/protobuf/util/message_differencer.h>

#include <algorithm>
#include <cassert>
#include <charconv>

#include "server/jobs/event_log.h"

namespace varimesh::server {
namespace {

using Code = Failure::Code;

bool matches(const v1::Job& job, const JobFilter& filter) {
  if (!filter.states.empty() &&
      std::find(filter.states.begin(), filter.states.end(), job.state()) == filter.states.end())
    return false;
  return std::all_of(filter.labels.begin(), filter.labels.end(), [&](const auto& label) {
    const auto found = job.spec().labels().find(label.first);
    return found != job.spec().labels().end() && found->second == label.second;
  });
}

}  // namespace

Answer<MemoryJobStore::Records::iterator> MemoryJobStore::find(const std::string& name) {
  const auto found = by_name_.find(name);
  if (found == by_name_.end())
    return failure(Code::NotFound, "JOB_NOT_FOUND", "There is no job '" + name + "'; list the jobs there are.",
                   {{"job", name}});
  return records_.find(found->second);
}

Answer<Submitted> MemoryJobStore::submit(const std::string& request_id, const v1::JobSpec& spec,
                                         const std::string& name, TimePoint now, int max_pending) {
  std::lock_guard lock(mutex_);
  if (!request_id.empty()) {
    const auto found = by_request_.find(request_id);
    if (found != by_request_.end()) {
      const v1::Job& job = records_.at(found->second).job;
      if (!google::protobuf::util::MessageDifferencer::Equals(job.spec(), spec))
        return failure(Code::AlreadyExists, "REQUEST_ID_USED",
                       "The request id '" + request_id + "' was used for " + job.name() +
                           ", which has another spec; choose a new one.",
                       {{"job", job.name()}});
      return Submitted{job, false};
    }
  }
  if (static_cast<int>(pending_.size()) >= max_pending)
    return failure(Code::ResourceExhausted, "QUEUE_FULL",
                   std::to_string(pending_.size()) + " jobs wait already, which is the most; try again later.", {}, 5);

  const std::int64_t key = ++counter_;
  Record& record = records_[key];
  record.job.set_name(name);
  record.job.set_state(v1::JOB_STATE_PENDING);
  *record.job.mutable_spec() = spec;
  record.job.set_request_id(request_id);
  *record.job.mutable_create_time() = timestamp(now);
  by_name_[name] = key;
  if (!request_id.empty()) by_request_[request_id] = key;
  pending_.push_back(key);
  return Submitted{record.job, true};
}

Answer<v1::Job> MemoryJobStore::get(const std::string& name) {
  std::lock_guard lock(mutex_);
  return find(name).map([](const auto& record) { return record->second.job; });
}

Answer<JobPage> MemoryJobStore::list(const JobFilter& filter, int page_size, const std::string& page_token) {
  // The token is the key of the last job on the page before; new jobs get larger ones, so that pages stay stable.
  std::int64_t below = 0;
  if (!page_token.empty()) {
    const auto parsed = std::from_chars(page_token.data(), page_token.data() + page_token.size(), below);
    if (parsed.ec != std::errc() || parsed.ptr != page_token.data() + page_token.size() || below <= 0)
      return failure(Code::InvalidArgument, "BAD_REQUEST", "The page token is not one that this server gave.");
  }
  std::lock_guard lock(mutex_);
  JobPage page;
  auto record = std::make_reverse_iterator(below > 0 ? records_.lower_bound(below) : records_.end());
  for (std::int64_t last = 0; record != records_.rend(); ++record) {
    if (!matches(record->second.job, filter)) continue;
    if (static_cast<int>(page.jobs.size()) == page_size) {
      page.next_page_token = std::to_string(last);
      break;
    }
    page.jobs.push_back(record->second.job);
    last = record->first;
  }
  return page;
}

JobCounts MemoryJobStore::counts() {
  std::lock_guard lock(mutex_);
  return {static_cast<int>(pending_.size()), running_};
}

std::optional<Claim> MemoryJobStore::claim(TimePoint now) {
  std::lock_guard lock(mutex_);
  if (pending_.empty()) return std::nullopt;
  Record& record = records_.at(pending_.front());
  pending_.pop_front();
  ++running_;
  ++record.token;
  record.job.set_state(v1::JOB_STATE_RUNNING);
  record.job.set_attempt(record.job.attempt() + 1);
  *record.job.mutable_start_time() = timestamp(now);
  return Claim{record.job.name(), record.token, record.job.attempt(), record.job.spec()};
}

Answer<v1::Job> MemoryJobStore::request_cancel(const std::string& name, TimePoint now) {
  std::lock_guard lock(mutex_);
  const auto found = find(name);
  if (!found) return tl::unexpected(found.error());
  const auto record = *found;
  v1::Job& job = record->second.job;
  if (job.state() == v1::JOB_STATE_PENDING) {
    std::erase(pending_, record->first);
    end(record, v1::JOB_STATE_CANCELLED, now);
  } else if (job.state() == v1::JOB_STATE_RUNNING) {
    job.set_state(v1::JOB_STATE_CANCELLING);
  }
  return job;
}

void MemoryJobStore::note_progress(const Claim& claim, const v1::Iteration& iteration, std::int64_t last_sequence) {
  std::lock_guard lock(mutex_);
  const auto found = find(claim.name);
  if (!found || (*found)->second.token != claim.token) return;
  *(*found)->second.job.mutable_iteration() = iteration;
  (*found)->second.job.set_last_sequence(last_sequence);
}

Answer<v1::Job> MemoryJobStore::finish(const Claim& claim, const Ending& ending, TimePoint now) {
  std::lock_guard lock(mutex_);
  const auto found = find(claim.name);
  if (!found) return tl::unexpected(found.error());
  Record& record = (*found)->second;
  if (record.token != claim.token)
    return failure(Code::Aborted, "CLAIM_LOST", "Another worker has taken " + claim.name + " over.");
  --running_;
  if (ending.error) *record.job.mutable_error() = *ending.error;
  if (ending.metrics) *record.job.mutable_metrics() = *ending.metrics;
  for (const v1::StoredMesh& result : ending.results) *record.job.add_results() = result;
  record.history_digest = ending.history_digest;
  end(*found, ending.state, now);
  return record.job;
}

void MemoryJobStore::end(Records::iterator record, v1::JobState state, TimePoint now) {
  assert(has_ended(state));
  record->second.job.set_state(state);
  *record->second.job.mutable_end_time() = timestamp(now);
  ended_.push_back(record->first);
}

Answer<std::string> MemoryJobStore::history_digest(const std::string& name) {
  std::lock_guard lock(mutex_);
  return find(name).map([](const auto& record) { return record->second.history_digest; });
}

Answer<Removed> MemoryJobStore::remove(const std::string& name) {
  std::lock_guard lock(mutex_);
  const auto found = find(name);
  if (!found) return tl::unexpected(found.error());
  const auto record = *found;
  const v1::Job& job = record->second.job;
  if (!has_ended(job.state()))
    return failure(Code::FailedPrecondition, "JOB_NOT_ENDED", name + " has not ended; cancel it first.",
                   {{"job", name}});
  Removed removed;
  for (const v1::StoredMesh& result : job.results()) removed.digests.push_back(result.digest());
  if (!record->second.history_digest.empty()) removed.digests.push_back(record->second.history_digest);
  by_name_.erase(name);
  if (!job.request_id().empty()) by_request_.erase(job.request_id());
  std::erase(ended_, record->first);
  records_.erase(record);
  return removed;
}

std::vector<std::string> MemoryJobStore::ended_beyond(std::size_t keep) {
  std::lock_guard lock(mutex_);
  std::vector<std::string> names;
  for (std::size_t i = 0; i + keep < ended_.size(); ++i) names.push_back(records_.at(ended_[i]).job.name());
  return names;
}

}  // namespace varimesh::server
