// The life of a job, from its submission to its deletion. Claims and leases are in leases.cpp, and what a submission
// must meet is in checks.cpp.
#include "server/scheduling/scheduler.h"

#include <algorithm>
#include <cassert>

#include "server/jobs/job_record.h"
#include "server/log/log_fields.h"
#include "server/refusals.h"
#include "server/scheduling/attempt.h"
#include "server/scheduling/run_spans.h"

namespace varimesh::server {

Scheduler::Scheduler(JobStore* jobs, MeshStore* meshes, Engine engine, SchedulerSettings settings)
    : jobs_(jobs),
      meshes_(meshes),
      engine_(std::move(engine)),
      settings_(std::move(settings)),
      memory_(settings_.memory),
      devices_(settings_.devices, settings_.jobs_per_device),
      submissions_(settings_.max_submissions, settings_.steady),
      logs_(jobs),
      owned_(*meshes) {}

Scheduler::~Scheduler() {
  jobs_->listen({});
  assert(running_.empty());
}

// ===== calls of clients =====

Answer<v1::Job> Scheduler::submit(const std::string& request_id, const v1::JobSpec& spec, bool validate_only,
                                  const Submitter& submitter) {
  if (request_id.size() > 128) return bad_request("The request id must have at most 128 bytes.");
  if (const auto checked = check(spec, submitter.is_admin); !checked) return tl::unexpected(checked.error());
  if (validate_only) {
    // The client now expects that the store keeps the mesh.
    for (const std::string& digest : inputs_of(spec))
      if (!meshes_->pin(digest)) return mesh_missing(digest);
    v1::Job job;
    *job.mutable_spec() = spec;
    return job;
  }
  if (!settings_.has_room())
    return store_full("The server's disk is nearly full, and the remaining space is reserved for the running jobs");
  if (stopping_) return server_stopping(5);
  if (const int seconds = submissions_.take(submitter.peer); seconds > 0)
    return too_many_submissions(submitter.peer, submissions_.most(), seconds);
  // The lock is not held, so that many submissions share a transaction; nobody knows the job before the store does. The
  // reference is counted first, since the job may be run and deleted before submit() returns.
  const std::vector<std::string> inputs = inputs_of(spec);
  for (const std::string& digest : inputs) meshes_->retain(digest);
  if (meshes_->counts_references()) owned_.add(submitter.owner, inputs);
  const auto take_back = [&] {
    release(inputs);
    owned_.remove(submitter.owner, inputs);
  };
  // A mesh that was deleted after check() has found it was not retained.
  for (const std::string& digest : inputs) {
    if (meshes_->touch(digest)) continue;
    take_back();
    submissions_.give_back(submitter.peer);
    return mesh_missing(digest);
  }
  const bool for_device = needs_device(spec);
  auto submitted = jobs_->submit({request_id, spec, settings_.new_name(), settings_.max_pending, submitter.peer,
                                  settings_.max_pending_of_peer, submitter.owner, submitter.trace, for_device});
  const bool is_new = submitted && !submitted->events.empty();
  // If the database did not tell the outcome, the job may exist and need its mesh. The next start counts again.
  const bool is_unknown = !submitted && submitted.error().reason == "STORE_UNAVAILABLE";
  if (!is_new && !is_unknown) take_back();
  if (!is_new) submissions_.give_back(submitter.peer);  // a repeated call makes no job
  if (!submitted) return tl::unexpected(submitted.error());
  if (!is_new) return get(submitted->job.name());
  settings_.log(submitted->job.name(), "submitted");
  settings_.noted(submitted->job);
  if (for_device) tell_of_missing_devices();
  start_jobs();
  return submitted->job;
}

Answer<v1::Job> Scheduler::get(const std::string& name) {
  auto job = jobs_->get(name);
  if (const auto log = logs_.find(name); job && log != nullptr)
    job->set_last_sequence(std::max(job->last_sequence(), log->last_sequence()));
  return job;
}

Answer<JobPage> Scheduler::list(const JobFilter& filter, int page_size, const std::string& page_token) {
  if (page_size < 0) return bad_request("The page size must not be negative.");
  for (const v1::JobState state : filter.states)
    if (!v1::JobState_IsValid(state) || state == v1::JOB_STATE_UNSPECIFIED)
      return bad_request("The state " + std::to_string(static_cast<int>(state)) +
                         " cannot be listed, since no job can be in it.");
  if (filter.labels.size() > 32) return bad_request("Jobs can be listed by at most 32 labels; no job has more.");
  return jobs_->list(filter, page_size == 0 ? 100 : std::min(page_size, 1000), page_token);
}

Answer<v1::Job> Scheduler::cancel(const std::string& name) {
  if (jobs_->shared() && !runs_here(name)) {
    const auto asked = jobs_->ask_to_cancel(name);
    if (!asked) return tl::unexpected(asked.error());
    logs_.publish(*asked);
    release(asked->released);
    if (!asked->events.empty()) note_end(asked->job);
    settings_.log(name, "cancel requested");
    return asked->job;
  }
  const auto changed = change(name, [&](std::int64_t last) { return jobs_->request_cancel(name, last); });
  if (changed && changed->events.empty()) return changed->job;
  if (!changed && changed.error().reason != "STORE_FULL") return tl::unexpected(changed.error());
  if (changed) note_end(changed->job);
  if (!stop_running(name) && !changed) return tl::unexpected(changed.error());
  settings_.log(name, changed ? "cancel requested" : "cancel requested, which the full disk cannot record");
  if (changed) return changed->job;
  auto job = jobs_->get(name);
  if (job && !has_ended(job->state())) job->set_state(v1::JOB_STATE_CANCELLING);
  return job;
}

bool Scheduler::stop_running(const std::string& name) {
  const std::lock_guard lock(mutex_);
  const auto running = running_.find(name);
  if (running == running_.end()) return false;
  running->second->cancelled = true;
  return true;
}

bool Scheduler::runs_here(const std::string& name) {
  std::lock_guard lock(mutex_);
  return running_.contains(name);
}

Answer<std::shared_ptr<EventLog>> Scheduler::events(const std::string& name) {
  auto log = logs_.of(name);
  if (log && jobs_->shared() && !runs_here(name)) logs_.follow(name);
  return log;
}

Answer<v1::Job> Scheduler::remove(const std::string& name) {
  const auto removed = jobs_->remove(name);
  if (!removed) return tl::unexpected(removed.error());
  forget(*removed);
  return removed->job;
}

Answer<v1::History> Scheduler::history(const std::string& name) {
  const auto digest = jobs_->history_digest(name);
  if (!digest) return tl::unexpected(digest.error());
  v1::History history;
  if (digest->empty()) return history;
  const auto blob = meshes_->open(*digest);
  if (!blob) return tl::unexpected(blob.error());
  const std::string_view bytes = (*blob)->bytes();
  if (!history.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())))
    return data_lost("The stored history of " + name + " cannot be read.");
  return history;
}

Answer<bool> Scheduler::has_job_with(const std::string& owner, const std::string& digest) {
  if (!jobs_->shared()) return owned_.has(owner, digest);
  JobFilter filter;
  filter.owner = owner;
  std::string token;
  do {
    const auto page = list(filter, 1000, token);
    if (!page) return tl::unexpected(page.error());
    for (const v1::Job& job : page->jobs) {
      const auto is_it = [&](const v1::StoredMesh& result) { return result.digest() == digest; };
      if (std::ranges::count(inputs_of(job.spec()), digest) > 0 || std::ranges::any_of(job.results(), is_it))
        return true;
    }
    token = page->next_page_token;
  } while (!token.empty());
  return false;
}

// ===== changes and their events =====

Answer<Changed> Scheduler::change(const std::string& name, const std::function<Answer<Changed>(std::int64_t)>& change) {
  const auto changed = logs_.change(name, change);
  if (changed) release(changed->released);
  return changed;
}

void Scheduler::release(const std::vector<std::string>& digests) {
  for (const std::string& digest : digests) meshes_->release(digest);
}

void Scheduler::forget(const Changed& removed) {
  release(removed.released);
  owned_.remove(removed.job.owner(), removed.released);
  logs_.forget(removed.job.name());
}

// ===== running =====

void Scheduler::finish_or_give_back(Running& running, const Ending& ending) {
  while (!finish(running, ending)) {
    // The disk is full, so the result waits for room. If the server stops, the next server runs the job again.
    {
      std::unique_lock lock(mutex_);
      if (!ended_.wait_for(lock, std::chrono::seconds(1), [this] { return stopping_.load(); })) continue;
    }
    if (give_back(running)) release(running, ending);
    break;
  }
}

void Scheduler::run(const std::shared_ptr<Running>& running, const LentThreads& threads) {
  const Claim& claim = running->claim;
  const LogScope scope({.job = claim.name,
                        .attempt = claim.attempt,
                        .owner = claim.owner,
                        .trace_id = trace_context(claim.trace).trace_id});
  settings_.log(claim.name, "started, attempt " + std::to_string(claim.attempt));
  const LentThreads lent{threads.now, [&](bool rests) { rest(threads, rests); }};
  Attempt attempt{claim,
                  engine_,
                  *meshes_,
                  *running->log,
                  lent,
                  memory_,
                  settings_.clock,
                  settings_.steady,
                  [&] { return running->cancelled.load(); },
                  [this] { return jobs_->durable() && stopping_; },
                  [&](const v1::Iteration& iteration) {
                    // A failure does not matter, since the next iteration follows soon.
                    [[maybe_unused]] const auto noted =
                        jobs_->note_progress(claim, iteration, running->log->last_sequence());
                  },
                  settings_.checkpoint_pause,
                  nullptr};
  if (jobs_->durable())
    attempt.note_checkpoint = [&](const CheckpointReference& checkpoint) {
      const auto noted = jobs_->note_checkpoint(claim, checkpoint);
      // If the database did not tell the outcome, the job may have the checkpoint.
      const bool is_unknown = !noted && stopping_ && noted.error().reason == "STORE_UNAVAILABLE";
      if (!noted && !is_unknown) meshes_->release(checkpoint.digest);
      if (noted) release(noted->released);
      return noted.has_value();
    };
  attempt.kernels_worked = settings_.kernels_worked;
  attempt.devices = &devices_;
  attempt.waits_for_room = [&] { settings_.log(claim.name, "waits for room on the full disk"); };
  attempt.stop_patience = [this] { return stop_patience_.load(); };
  RunSpans spans(settings_.spans, claim, settings_.clock);
  attempt.on_stage = [&](const std::string& stage, TimePoint since) { spans.enter(stage, since); };
  const Ending ending = run_attempt(attempt);
  spans.end(ending);
  settings_.log(claim.name, v1::JobState_Name(ending.state) +
                                (ending.error ? ": " + ending.error->message() : std::string()) +
                                (ending.lost.empty() ? "" : ": the process that ran it " + ending.lost));
  std::vector<std::string> results;
  for (const v1::StoredMesh& result : ending.results) results.push_back(result.digest());
  owned_.add(claim.owner, results);
  finish_or_give_back(*running, ending);
  start_jobs();
  // This must be the last statement: when the count is 0, no thread uses this object any more.
  std::lock_guard lock(mutex_);
  --inside_;
  ended_.notify_all();
}

void Scheduler::rest(const LentThreads& threads, bool rests) {
  threads.rest(rests);
  {
    std::lock_guard lock(mutex_);
    resting_ += rests ? 1 : -1;
  }
  if (rests) start_jobs();
}

bool Scheduler::give_back(const Running& running) {
  const std::string& name = running.claim.name;
  Ending ending;
  ending.state = v1::JOB_STATE_PENDING;
  const auto given = change(name, [&](std::int64_t last) { return jobs_->finish(running.claim, ending, last); });
  settings_.log(name,
                given ? "was left to the next server" : "cannot be left to the next server: " + given.error().sentence);
  erase(running);
  return given.has_value();
}

void Scheduler::erase(const Running& running) {
  std::lock_guard lock(mutex_);
  const auto found = running_.find(running.claim.name);
  if (found != running_.end() && found->second.get() == &running) running_.erase(found);
}

bool Scheduler::finish(const Running& running, const Ending& ending) {
  const std::string& name = running.claim.name;
  const auto finished = change(name, [&](std::int64_t last) { return jobs_->finish(running.claim, ending, last); });
  if (!finished) {
    const Failure::Code code = finished.error().code;
    const bool lost =
        code == Failure::Code::Aborted || code == Failure::Code::NotFound || code == Failure::Code::DataLoss;
    settings_.log(name, "cannot be finished: " + finished.error().sentence);
    if (!lost) return false;
    // Another worker has the job now, or its record is gone or damaged. The results of this attempt are deleted.
    release(running, ending);
  } else {
    note_end(finished->job);
  }
  erase(running);
  forget_old();
  return true;
}

void Scheduler::forget_old() {
  const TimePoint now = settings_.clock();
  const auto forget_beyond = [this](std::size_t keep, TimePoint before) {
    const auto old = jobs_->ended_beyond(keep, before);
    if (!old) return;
    for (const std::string& name : *old)
      if (const auto removed = jobs_->remove(name)) forget(*removed);
  };
  forget_beyond(static_cast<std::size_t>(settings_.max_ended), now - settings_.min_ended_age);
  if (settings_.max_ended_age.count() > 0) forget_beyond(0, now - settings_.max_ended_age);
}

void Scheduler::release(const Running& running, const Ending& ending) {
  for (const v1::StoredMesh& result : ending.results) {
    meshes_->release(result.digest());
    owned_.remove(running.claim.owner, {result.digest()});
  }
  if (!ending.history_digest.empty()) meshes_->release(ending.history_digest);
}

// ===== stopping =====

void Scheduler::stop(std::chrono::milliseconds patience) {
  std::lock_guard lock(mutex_);
  stop_patience_ = patience;
  stopping_ = true;
  ended_.notify_all();
  if (jobs_->durable()) return;
  for (const auto& [name, running] : running_) running->cancelled = true;
}

bool Scheduler::drain(std::chrono::steady_clock::time_point deadline) {
  note_devices(false);
  std::map<std::string, std::shared_ptr<Running>> left;
  {
    std::unique_lock lock(mutex_);
    if (ended_.wait_until(lock, deadline, [this] { return inside_ == 0; })) return true;
    if (!jobs_->durable()) return false;
    left = running_;
  }
  for (const auto& [name, running] : left) give_back(*running);
  return false;
}

}  // namespace varimesh::server
