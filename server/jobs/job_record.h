// The record of a job in a store, and the rules of how it changes. All stores share them.
#pragma once

#include "server/jobs/job_store.h"

namespace varimesh::server {

/// What a store keeps of a job.
struct JobRecord {
  v1::Job job;             ///< With its owner. `last_sequence` is the last event number that the store knows.
  std::int64_t token = 0;  ///< Of the newest claim.
  int lost = 0;            ///< Attempts that were lost since the last progress: 1 for each that the job may be to blame
                           ///< for, kInnocentLoss for each that was lost with a worker that isolates its jobs.
  int furthest = 0;        ///< The last iteration that any attempt is known to have reached.
  std::string peer;        ///< Who the limits per peer count. Empty: unknown.
  std::string worker;      ///< Empty: no worker runs the job.
  TimePoint lease_end{};
  std::string history_digest;
  std::optional<CheckpointReference> checkpoint;
  std::string trace;           ///< The place of the job in a trace (Submission); empty: none.
  bool cancel_unseen = false;  ///< The job is CANCELLING, but there is no event of that yet.
  /// When the webhook of the job is to be called next; nothing: it is not.
  std::optional<TimePoint> call_due;
};

inline constexpr int kInnocentLoss = 1000;

/// The changes of a job. Each function changes the record and nothing else, and returns the events of the change and
/// the digests that it releases. The store saves the record and the events in one transaction.
class JobTransitions {
 public:
  explicit JobTransitions(const JobStoreSettings& settings) : settings_(settings) {}

  const JobStoreSettings& settings() const { return settings_; }

  Changed create(JobRecord& record, const Submission& submission) const;
  Changed claim(JobRecord& record, const std::string& worker) const;
  /// CLAIM_LOST if another worker has the job, or the job has ended.
  Answer<void> check(const JobRecord& record, const Claim& claim) const;
  /// Renews the lease.
  void renew(JobRecord& record) const { record.lease_end = settings_.clock() + settings_.lease; }
  Changed finish(JobRecord& record, const Ending& ending, std::int64_t last_sequence) const;
  Changed cancel(JobRecord& record, std::int64_t last_sequence) const;
  /// Asks for the end of a job whose event numbers only its worker knows.
  Changed ask_to_cancel(JobRecord& record) const;
  /// Adds the event that ask_to_cancel() has left out.
  Changed see_cancel(JobRecord& record, std::int64_t last_sequence) const;
  void note_progress(JobRecord& record, const v1::Iteration& iteration, std::int64_t last_sequence) const;
  Changed note_checkpoint(JobRecord& record, const CheckpointReference& checkpoint) const;
  /// Returns whether the job is lost, so that take_back() applies to it.
  bool is_lost(const JobRecord& record, const std::string& worker, const std::set<std::string>& running) const;
  Changed take_back(JobRecord& record) const;
  /// Somebody calls the webhook of the job. It is called again after `patience` unless note_call() is called before.
  void claim_call(JobRecord& record, std::chrono::milliseconds patience) const;
  /// Returns false if the call has ended already, so that nothing changes.
  bool note_call(JobRecord& record, const CallOutcome& outcome) const;
  /// Tells that the job waits for a device and no server lends one.
  Changed tell_of_missing_devices(JobRecord& record) const;

 private:
  v1::JobEvent number(JobRecord& record, v1::JobEvent event) const;
  v1::JobEvent change_state(JobRecord& record, v1::JobState state) const;

  const JobStoreSettings settings_;
};

/// Returns the position of a job in the queue, in milliseconds. The job with the smallest value is next; among equal
/// values, the oldest.
std::int64_t turn_of(const v1::Job& job);
/// Returns the newest claim of the job.
Claim claim_of(const JobRecord& record);
/// Returns the digests of the mesh and, if the job has one, of the geometry.
std::vector<std::string> inputs_of(const v1::JobSpec& spec);
/// Returns the digests of everything in the mesh store that the record refers to.
std::vector<std::string> digests_of(const JobRecord& record);
/// Adds the digests that the next attempt reads.
void add_needed(const JobRecord& record, std::set<std::string>* digests);
/// REQUEST_ID_USED if a repeated submission has another spec than the job.
Answer<void> check_same(const v1::Job& job, const Submission& submission);

/// Whether the queue takes no job of a peer that has `of_peer` of the `pending` waiting jobs. When it is full, it still
/// takes one job of each peer that has none there, so that nobody can keep others out; it grows to twice `most`.
inline bool is_full(std::int64_t pending, std::int64_t of_peer, std::int64_t most) {
  return pending >= most && (of_peer > 0 || pending >= 2 * most);
}

/// PEER_LIMIT: the peer already has this many waiting jobs.
Refusal too_many_waiting(const std::string& peer, int pending);
/// Returns the key of the last job on the previous page, from the token that a store gave; 0: no previous page.
Answer<std::int64_t> parse_page_token(const std::string& token);

}  // namespace varimesh::server
