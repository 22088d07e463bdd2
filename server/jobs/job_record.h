// What a store keeps of a job, and how it changes: the rules that all stores share.
#pragma once

#include "server/jobs/job_store.h"

namespace varimesh::server {

struct JobRecord {
  v1::Job job;  ///< `last_sequence` is the last number known to the store.
  std::int64_t token = 0;
  int lost = 0;      ///< Attempts that ended with their worker since one came further than all before it.
  int furthest = 0;  ///< The last iteration that any attempt is known to have come to.
  std::string owner;
  std::string worker;
  TimePoint lease_end{};
  std::string history_digest;
  std::optional<CheckpointReference> checkpoint;
};

/// The changes of a job's state, each with the events that tell of it and the digests that it releases. Each adjusts
/// the record, and nothing else; the store saves both in one transaction.
class JobTransitions {
 public:
  explicit JobTransitions(const JobStoreSettings& settings) : settings_(settings) {}

  const JobStoreSettings& settings() const { return settings_; }

  Changed create(JobRecord& record, const Submission& submission) const;
  Changed claim(JobRecord& record, const std::string& worker) const;
  /// CLAIM_LOST where the record is another worker's, or the job has ended.
  Answer<void> check(const JobRecord& record, const Claim& claim) const;
  void renew(JobRecord& record) const { record.lease_end = settings_.clock() + settings_.lease; }
  Changed finish(JobRecord& record, const Ending& ending, std::int64_t last_sequence) const;
  Changed cancel(JobRecord& record, std::int64_t last_sequence) const;
  void note_progress(JobRecord& record, const v1::Iteration& iteration, std::int64_t last_sequence) const;
  Changed note_checkpoint(JobRecord& record, const CheckpointReference& checkpoint) const;
  /// Whether take_back() is for this record.
  bool is_lost(const JobRecord& record, const std::string& worker, const std::set<std::string>& running) const;
  Changed take_back(JobRecord& record) const;

 private:
  v1::JobEvent number(JobRecord& record, v1::JobEvent event) const;
  v1::JobEvent change_state(JobRecord& record, v1::JobState state) const;

  const JobStoreSettings settings_;
};

/// Where a job stands in the queue: the smallest goes first, of equal ones the oldest. In milliseconds.
std::int64_t turn_of(const v1::Job& job);
/// Everything that the record refers to in the mesh store.
std::vector<std::string> digests_of(const JobRecord& record);
/// What the next attempt reads.
void add_needed(const JobRecord& record, std::set<std::string>* digests);
bool matches(const v1::Job& job, const JobFilter& filter);
/// Whether a repeated submission is the same; the sentence says so where not.
Answer<void> check_same(const v1::Job& job, const Submission& submission);

tl::unexpected<Failure> job_not_found(const std::string& name);
tl::unexpected<Failure> job_not_ended(const std::string& name);
tl::unexpected<Failure> queue_full(int pending);
tl::unexpected<Failure> owner_full(const std::string& owner, int pending);
/// The key of the last job on the page before, from a token that a store gave; 0: from the newest.
Answer<std::int64_t> parse_page_token(const std::string& token);

}  // namespace varimesh::server
