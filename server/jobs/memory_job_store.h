// A job store in memory. The jobs are lost when the process ends.
#pragma once

#include <deque>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <utility>

#include "server/jobs/job_record.h"
#include "server/jobs/turns.h"

namespace varimesh::server {

/// A job store of maps under one lock.
class MemoryJobStore : public JobStore {
 public:
  explicit MemoryJobStore(const JobStoreSettings& settings = {}) : transitions_(settings) {}

  bool durable() const override { return false; }
  Answer<Changed> submit(const Submission& submission) override;
  Answer<v1::Job> get(const std::string& name) override;
  Answer<JobPage> list(const JobFilter& filter, int page_size, const std::string& page_token) override;
  Answer<JobCounts> counts() override;
  Answer<std::optional<TimePoint>> oldest_pending() override;
  Answer<std::vector<v1::JobEvent>> events(const std::string& name) override;
  Answer<std::optional<Claimed>> claim(const std::string& worker) override;
  Answer<bool> renew_lease(const Claim& claim) override;
  Answer<void> note_progress(const Claim& claim, const v1::Iteration& iteration, std::int64_t last_sequence) override;
  Answer<Changed> note_checkpoint(const Claim& claim, const CheckpointReference& checkpoint) override;
  Answer<Changed> finish(const Claim& claim, const Ending& ending, std::int64_t last_sequence) override;
  Answer<Changed> request_cancel(const std::string& name, std::int64_t last_sequence) override;
  Answer<std::vector<Changed>> take_back(const std::string& worker, const std::set<std::string>& running) override;
  Answer<std::string> history_digest(const std::string& name) override;
  Answer<Changed> remove(const std::string& name) override;
  Answer<std::vector<std::string>> ended_beyond(std::size_t keep, TimePoint before) override;
  Answer<std::vector<Reference>> references() override;
  Answer<std::set<std::string>> needed_digests() override;

 private:
  struct Entry {
    JobRecord record;
    std::vector<v1::JobEvent> events;
  };
  using Entries = std::map<std::int64_t, Entry>;  ///< By number, in the order of submission.

  Answer<Entries::iterator> find(const std::string& name);
  Answer<Entries::iterator> find(const Claim& claim);
  /// Updates the queues after a transition, and stores its events.
  Changed apply(Entries::iterator entry, v1::JobState before, Changed changed);

  const JobTransitions transitions_;
  std::mutex mutex_;
  std::int64_t counter_ = 0;
  Entries entries_;
  std::map<std::string, std::int64_t> by_name_;
  std::map<std::pair<std::string, std::string>, std::int64_t> by_request_;  ///< By owner and request id.
  using Queue = std::set<std::pair<std::int64_t, std::int64_t>>;            ///< By turn, then by number.
  std::map<std::string, Queue> pending_;                                    ///< By peer, without empty queues.
  int pending_count_ = 0;
  std::map<std::string, int> running_of_;  ///< By peer.
  Turns turns_;
  std::set<std::int64_t> running_;
  std::map<std::string, std::deque<std::int64_t>> ended_;  ///< By owner, without empty queues.
};

}  // namespace varimesh::server
