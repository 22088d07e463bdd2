// The rules of a job's life.
#include "server/jobs/job_record.h"

#include <google/protobuf/util/message_differencer.h>

#include <algorithm>
#include <cassert>
#include <charconv>
#include <utility>

#include "server/jobs/event_log.h"
#include "server/jobs/timestamps.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

v1::JobEvent quality(v1::QualityEvent::Stage stage, const v1::QualityReport& report) {
  v1::JobEvent event;
  event.mutable_quality()->set_stage(stage);
  *event.mutable_quality()->mutable_report() = report;
  return event;
}

v1::JobError lost_too_often(int times) {
  v1::JobError error;
  error.set_reason("LOST");
  error.set_message("The server ended " + std::to_string(times) +
                    " times while it ran this job, and the job made no progress; check the server's log and the mesh "
                    "before you submit the job again.");
  return error;
}

v1::JobError lost_with_its_process(int times, const std::string& why) {
  v1::JobError error;
  error.set_reason("LOST");
  error.set_message("The process that ran this job " + why + ", " + std::to_string(times) +
                    " times without progress; check the mesh and the server's log before you submit the job again.");
  return error;
}

}  // namespace

// ===== transitions =====

v1::JobEvent JobTransitions::number(JobRecord& record, v1::JobEvent event) const {
  record.job.set_last_sequence(record.job.last_sequence() + 1);
  event.set_sequence(record.job.last_sequence());
  event.set_attempt(record.job.attempt());
  *event.mutable_time() = timestamp(settings_.clock());
  return event;
}

v1::JobEvent JobTransitions::change_state(JobRecord& record, v1::JobState state) const {
  record.job.set_state(state);
  if (state != v1::JOB_STATE_RUNNING && state != v1::JOB_STATE_CANCELLING) record.worker.clear();
  if (has_ended(state)) {
    *record.job.mutable_end_time() = timestamp(settings_.clock());
    if (record.job.spec().has_webhook()) {
      record.job.mutable_webhook_call()->set_state(v1::WebhookCall::STATE_WAITING);
      record.call_due = settings_.clock();
    }
  }
  v1::JobEvent event;
  event.mutable_state_change()->set_state(state);
  if (record.job.has_error()) *event.mutable_state_change()->mutable_error() = record.job.error();
  return number(record, std::move(event));
}

Changed JobTransitions::create(JobRecord& record, const Submission& submission) const {
  record.job.set_name(submission.name);
  *record.job.mutable_spec() = submission.spec;
  record.job.set_request_id(submission.request_id);
  record.job.set_owner(submission.owner);
  record.trace = submission.trace;
  record.peer = submission.peer;
  *record.job.mutable_create_time() = timestamp(settings_.clock());
  v1::JobEvent event = change_state(record, v1::JOB_STATE_PENDING);
  return {record.job, {std::move(event)}, {}};
}

Changed JobTransitions::claim(JobRecord& record, const std::string& worker) const {
  assert(record.job.state() == v1::JOB_STATE_PENDING);
  ++record.token;
  record.worker = worker;
  renew(record);
  record.job.set_attempt(record.job.attempt() + 1);
  *record.job.mutable_start_time() = timestamp(settings_.clock());
  v1::JobEvent event = change_state(record, v1::JOB_STATE_RUNNING);
  return {record.job, {std::move(event)}, {}};
}

Answer<void> JobTransitions::check(const JobRecord& record, const Claim& claim) const {
  if (record.token == claim.token && !record.worker.empty()) return {};
  return claim_lost(claim.name);
}

Changed JobTransitions::finish(JobRecord& record, const Ending& ending, std::int64_t last_sequence) const {
  Changed changed = see_cancel(record, last_sequence);
  record.job.set_last_sequence(std::max(record.job.last_sequence(), last_sequence));
  // If the job was cancelled just before its attempt was given up, it stays cancelled.
  const bool cancelled = ending.state == v1::JOB_STATE_PENDING && record.job.state() == v1::JOB_STATE_CANCELLING;
  v1::JobState state = cancelled ? v1::JOB_STATE_CANCELLED : ending.state;
  if (!ending.lost.empty() && !cancelled && ++record.lost % kInnocentLoss >= settings_.max_attempts) {
    state = v1::JOB_STATE_FAILED;
    *record.job.mutable_error() = lost_with_its_process(record.lost % kInnocentLoss, ending.lost);
  }
  if (ending.error) *record.job.mutable_error() = *ending.error;
  if (ending.metrics) {
    *record.job.mutable_metrics() = *ending.metrics;
    changed.events.push_back(number(record, quality(v1::QualityEvent::STAGE_BEFORE, ending.metrics->before())));
    changed.events.push_back(number(record, quality(v1::QualityEvent::STAGE_AFTER, ending.metrics->after())));
  }
  for (const v1::StoredMesh& result : ending.results) *record.job.add_results() = result;
  record.history_digest = ending.history_digest;
  changed.events.push_back(change_state(record, state));
  if (record.checkpoint && has_ended(state)) {
    changed.released.push_back(record.checkpoint->digest);
    record.checkpoint.reset();
  }
  changed.job = record.job;
  return changed;
}

Changed JobTransitions::cancel(JobRecord& record, std::int64_t last_sequence) const {
  Changed changed;
  if (record.job.state() == v1::JOB_STATE_PENDING || record.job.state() == v1::JOB_STATE_RUNNING) {
    record.job.set_last_sequence(std::max(record.job.last_sequence(), last_sequence));
    const bool waits = record.job.state() == v1::JOB_STATE_PENDING;
    changed.events.push_back(change_state(record, waits ? v1::JOB_STATE_CANCELLED : v1::JOB_STATE_CANCELLING));
    if (waits && record.checkpoint) {
      changed.released.push_back(record.checkpoint->digest);
      record.checkpoint.reset();
    }
  }
  changed.job = record.job;
  return changed;
}

Changed JobTransitions::ask_to_cancel(JobRecord& record) const {
  if (record.job.state() != v1::JOB_STATE_RUNNING) return cancel(record, 0);
  record.job.set_state(v1::JOB_STATE_CANCELLING);
  record.cancel_unseen = true;
  return {record.job, {}, {}};
}

Changed JobTransitions::see_cancel(JobRecord& record, std::int64_t last_sequence) const {
  Changed changed;
  if (std::exchange(record.cancel_unseen, false)) {
    record.job.set_last_sequence(std::max(record.job.last_sequence(), last_sequence));
    changed.events.push_back(change_state(record, v1::JOB_STATE_CANCELLING));
  }
  changed.job = record.job;
  return changed;
}

void JobTransitions::note_progress(JobRecord& record, const v1::Iteration& iteration,
                                   std::int64_t last_sequence) const {
  *record.job.mutable_iteration() = iteration;
  record.job.set_last_sequence(std::max(record.job.last_sequence(), last_sequence));
  if (iteration.number() <= record.furthest) return;
  record.furthest = iteration.number();
  // Only attempts without progress count, since a job that makes the server crash does not get past that point.
  record.lost = 0;
}

Changed JobTransitions::note_checkpoint(JobRecord& record, const CheckpointReference& checkpoint) const {
  Changed changed{record.job, {}, {}};
  // The next attempt starts later than this one, so this one does not count if it is lost.
  if (!record.checkpoint || checkpoint.iteration > record.checkpoint->iteration) record.lost = 0;
  if (record.checkpoint) changed.released.push_back(record.checkpoint->digest);
  record.checkpoint = checkpoint;
  renew(record);
  return changed;
}

bool JobTransitions::is_lost(const JobRecord& record, const std::string& worker,
                             const std::set<std::string>& running) const {
  if (record.worker.empty() || running.contains(record.job.name())) return false;
  return record.worker == worker || record.lease_end <= settings_.clock();
}

Changed JobTransitions::take_back(JobRecord& record) const {
  // Nobody knows how many iterations of the lost attempt were delivered, so the next event starts a new range of
  // numbers.
  record.job.set_last_sequence(
      std::max(record.job.last_sequence(), (record.job.last_sequence() / kSequenceRange + 1) * kSequenceRange));
  Changed changed = see_cancel(record, 0);
  v1::JobState state = v1::JOB_STATE_PENDING;
  const bool is_innocent = record.worker.ends_with(kIsolating);
  record.lost += is_innocent ? kInnocentLoss : 1;
  const int losses = is_innocent ? record.lost / kInnocentLoss : record.lost % kInnocentLoss;
  if (record.job.state() == v1::JOB_STATE_CANCELLING) {
    state = v1::JOB_STATE_CANCELLED;
  } else if (losses >= (is_innocent ? settings_.max_innocent_losses : settings_.max_attempts)) {
    state = v1::JOB_STATE_FAILED;
    *record.job.mutable_error() = lost_too_often(losses);
  }
  if (has_ended(state) && record.checkpoint) {
    changed.released.push_back(record.checkpoint->digest);
    record.checkpoint.reset();
  }
  changed.events.push_back(change_state(record, state));
  changed.job = record.job;
  return changed;
}

void JobTransitions::claim_call(JobRecord& record, std::chrono::milliseconds patience) const {
  record.call_due = settings_.clock() + patience;
}

bool JobTransitions::note_call(JobRecord& record, const CallOutcome& outcome) const {
  v1::WebhookCall& call = *record.job.mutable_webhook_call();
  // Somebody else may have made the call too, if this one took longer than the claim.
  if (call.state() != v1::WebhookCall::STATE_WAITING) return false;
  if (outcome.was_made) call.set_attempts(call.attempts() + 1);
  call.set_error(outcome.error);
  record.call_due.reset();
  if (outcome.again_after)
    record.call_due = settings_.clock() + *outcome.again_after;
  else
    call.set_state(outcome.error.empty() ? v1::WebhookCall::STATE_DELIVERED : v1::WebhookCall::STATE_GIVEN_UP);
  return true;
}

Changed JobTransitions::tell_of_missing_devices(JobRecord& record) const {
  v1::JobEvent event;
  event.mutable_log()->set_text(
      "The job waits for a device, and no server that runs now has one for jobs. It begins when such a server is "
      "there; to have it run on a processor, cancel it and submit it with another choice of device.");
  event = number(record, std::move(event));
  return {record.job, {std::move(event)}, {}};
}

// ===== questions about a record =====

std::int64_t turn_of(const v1::Job& job) {
  using std::chrono::duration_cast, std::chrono::milliseconds;
  const auto created = duration_cast<milliseconds>(time_point(job.create_time()).time_since_epoch());
  return (created - job.spec().priority() * duration_cast<milliseconds>(kPriorityStep)).count();
}

Claim claim_of(const JobRecord& record) {
  const v1::Job& job = record.job;
  return {job.name(),
          record.token,
          job.attempt(),
          job.spec(),
          record.checkpoint,
          job.owner(),
          record.trace,
          time_point(job.create_time()),
          record.lost % kInnocentLoss};
}

std::vector<std::string> inputs_of(const v1::JobSpec& spec) {
  std::vector<std::string> digests{spec.mesh().digest()};
  if (!spec.geometry().digest().empty()) digests.push_back(spec.geometry().digest());
  return digests;
}

std::vector<std::string> digests_of(const JobRecord& record) {
  std::vector<std::string> digests = inputs_of(record.job.spec());
  for (const v1::StoredMesh& result : record.job.results()) digests.push_back(result.digest());
  if (!record.history_digest.empty()) digests.push_back(record.history_digest);
  if (record.checkpoint) digests.push_back(record.checkpoint->digest);
  return digests;
}

void add_needed(const JobRecord& record, std::set<std::string>* digests) {
  for (std::string& digest : inputs_of(record.job.spec())) digests->insert(std::move(digest));
  if (record.checkpoint) digests->insert(record.checkpoint->digest);
}

Answer<void> check_same(const v1::Job& job, const Submission& submission) {
  if (google::protobuf::util::MessageDifferencer::Equals(job.spec(), submission.spec)) return {};
  return request_id_used(submission.request_id, job.name());
}

Refusal too_many_waiting(const std::string& peer, int pending) { return peer_limit(peer, pending, "waiting jobs"); }

Answer<std::int64_t> parse_page_token(const std::string& token) {
  if (token.empty()) return 0;
  std::int64_t key = 0;
  const auto parsed = std::from_chars(token.data(), token.data() + token.size(), key);
  if (parsed.ec != std::errc() || parsed.ptr != token.data() + token.size() || key <= 0)
    return bad_request("The page token was not issued by this server.");
  return key;
}

}  // namespace varimesh::server
