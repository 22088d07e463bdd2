// The life of a job, from its submission to being forgotten.
#include "server/jobs/scheduler.h"

#include <algorithm>
#include <cassert>
#include <set>

#include "server/jobs/translate.h"
#include "server/jobs/worker.h"
#include "server/meshes/sha256.h"

namespace varimesh::server {
namespace {

using Code = Failure::Code;

tl::unexpected<Failure> bad_request(std::string sentence) {
  return failure(Code::InvalidArgument, "BAD_REQUEST", std::move(sentence));
}

}  // namespace

Scheduler::Scheduler(JobStore* jobs, MeshStore* meshes, Engine engine, SchedulerSettings settings)
    : jobs_(jobs), meshes_(meshes), engine_(std::move(engine)), settings_(std::move(settings)) {}

Scheduler::~Scheduler() { assert(running_.empty()); }

// ===== what callers ask =====

Answer<void> Scheduler::check(const v1::JobSpec& spec) {
  if (!is_digest(spec.mesh().digest()))
    return bad_request("The spec must name its mesh by SHA-256: 64 hexadecimal digits in small letters.");
  if (!v1::MeshFormat_IsValid(spec.mesh().format()) || spec.mesh().format() == v1::MESH_FORMAT_VTU)
    return bad_request("The mesh's format is not one that this server reads; GetServerInfo lists them.");
  std::set<int> outputs;
  for (const int output : spec.outputs()) {
    if (!v1::MeshFormat_IsValid(output))
      return bad_request("An output's format is not one that this server writes; GetServerInfo lists them.");
    if (!outputs.insert(output).second)
      return bad_request("The same output format is asked for twice; once is enough.");
  }
  if (spec.labels().size() > 32) return bad_request("A job can have at most 32 labels.");
  for (const auto& [key, value] : spec.labels())
    if (key.empty() || key.size() > 128 || value.size() > 128)
      return bad_request("A label's key must have 1 to 128 bytes, and its value at most 128.");
  const auto options = options_from(spec.options());
  if (!options) return tl::unexpected(options.error());
  if (const auto accepted = engine_.check_options(*options); !accepted)
    return failure(Code::InvalidArgument, "BAD_OPTION", accepted.error().sentence);
  if (!meshes_->pin(spec.mesh().digest()))
    return failure(Code::FailedPrecondition, "MESH_NOT_FOUND",
                   "The mesh " + spec.mesh().digest() + " is not in the store; upload it and submit again.",
                   {{"digest", spec.mesh().digest()}});
  return {};
}

Answer<v1::Job> Scheduler::submit(const std::string& request_id, const v1::JobSpec& spec, bool validate_only) {
  if (request_id.size() > 128) return bad_request("The request id must have at most 128 bytes.");
  if (const auto checked = check(spec); !checked) return tl::unexpected(checked.error());
  if (validate_only) {
    v1::Job job;
    *job.mutable_spec() = spec;
    return job;
  }
  v1::Job job;
  {
    std::lock_guard lock(mutex_);
    if (stopping_)
      return failure(Code::Unavailable, "STOPPING", "The server is stopping; submit again when it is back.", {}, 5);
    auto submitted = jobs_->submit(request_id, spec, settings_.new_name(), settings_.clock(), settings_.max_pending);
    if (!submitted) return tl::unexpected(submitted.error());
    job = submitted->job;
    const auto log = log_of(job.name());
    if (submitted->created) append_state(*log, v1::JOB_STATE_PENDING, 0);
    job.set_last_sequence(log->last_sequence());
  }
  settings_.log(job.name(), "submitted");
  start_jobs();
  return job;
}

Answer<v1::Job> Scheduler::get(const std::string& name) {
  auto job = jobs_->get(name);
  if (job) {
    std::lock_guard lock(mutex_);
    if (const auto log = logs_.find(name); log != logs_.end()) job->set_last_sequence(log->second->last_sequence());
  }
  return job;
}

Answer<JobPage> Scheduler::list(const JobFilter& filter, int page_size, const std::string& page_token) {
  if (page_size < 0) return bad_request("The page size must not be negative.");
  return jobs_->list(filter, page_size == 0 ? 100 : std::min(page_size, 1000), page_token);
}

Answer<v1::Job> Scheduler::cancel(const std::string& name) {
  std::lock_guard lock(mutex_);
  const auto before = jobs_->get(name);
  auto job = jobs_->request_cancel(name, settings_.clock());
  if (!before || !job || job->state() == before->state()) return job;
  const auto log = log_of(name);
  append_state(*log, job->state(), job->attempt());
  if (const auto running = running_.find(name); running != running_.end()) running->second->cancelled = true;
  if (has_ended(job->state())) log->close();
  job->set_last_sequence(log->last_sequence());
  settings_.log(name, "cancel requested");
  return job;
}

Answer<v1::Job> Scheduler::remove(const std::string& name) {
  std::lock_guard lock(mutex_);
  auto job = jobs_->get(name);
  if (!job) return job;
  const auto removed = jobs_->remove(name);
  if (!removed) return tl::unexpected(removed.error());
  for (const std::string& digest : removed->digests) meshes_->release(digest);
  logs_.erase(name);
  return job;
}

Answer<std::shared_ptr<EventLog>> Scheduler::events(const std::string& name) {
  // Under the lock: a job removed between the look and the log would leave a log that nobody ever ends.
  std::lock_guard lock(mutex_);
  const auto job = jobs_->get(name);
  if (!job) return tl::unexpected(job.error());
  return log_of(name);
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
    return failure(Code::DataLoss, "INTERNAL", "The stored history of " + name + " cannot be read.");
  return history;
}

// ===== running =====

std::shared_ptr<EventLog> Scheduler::log_of(const std::string& name) {
  std::shared_ptr<EventLog>& log = logs_[name];
  if (log == nullptr) log = std::make_shared<EventLog>();
  return log;
}

void Scheduler::append_state(EventLog& log, v1::JobState state, int attempt, const v1::JobError* error) {
  v1::JobEvent event;
  event.set_attempt(attempt);
  *event.mutable_time() = timestamp(settings_.clock());
  event.mutable_state_change()->set_state(state);
  if (error != nullptr) *event.mutable_state_change()->mutable_error() = *error;
  log.append(std::move(event));
}

void Scheduler::start_jobs() {
  while (true) {
    auto running = std::make_shared<Running>();
    {
      std::lock_guard lock(mutex_);
      if (stopping_ || static_cast<int>(running_.size()) >= settings_.threads) return;
      auto claim = jobs_->claim(settings_.clock());
      if (!claim) return;
      running->claim = std::move(*claim);
      running->log = log_of(running->claim.name);
      running_[running->claim.name] = running;
      ++inside_;
      append_state(*running->log, v1::JOB_STATE_RUNNING, running->claim.attempt);
    }
    const int asked = running->claim.spec.options().threads();
    settings_.launch(asked > 0 ? std::min(asked, settings_.threads) : settings_.threads,
                     [this, running] { run(running); });
  }
}

void Scheduler::run(const std::shared_ptr<Running>& running) {
  settings_.log(running->claim.name, "started");
  const Ending ending = run_attempt({running->claim, engine_, *meshes_, *running->log, settings_.threads,
                                     settings_.clock, [&] { return running->cancelled.load(); },
                                     [&](const v1::Iteration& iteration) {
                                       jobs_->note_progress(running->claim, iteration, running->log->last_sequence());
                                     }});
  settings_.log(running->claim.name,
                v1::JobState_Name(ending.state) + (ending.error ? ": " + ending.error->message() : std::string()));
  finish(*running, ending);
  start_jobs();
  // The very last thing: when the count is 0, nobody is in here any more.
  std::lock_guard lock(mutex_);
  --inside_;
  ended_.notify_all();
}

void Scheduler::finish(const Running& running, const Ending& ending) {
  std::lock_guard lock(mutex_);
  const auto finished = jobs_->finish(running.claim, ending, settings_.clock());
  if (finished) {
    append_state(*running.log, ending.state, running.claim.attempt, ending.error ? &*ending.error : nullptr);
    running.log->close();
  } else {
    // Somebody else has the job now: what this attempt wrote is nobody's.
    for (const v1::StoredMesh& result : ending.results) meshes_->release(result.digest());
    if (!ending.history_digest.empty()) meshes_->release(ending.history_digest);
  }
  running_.erase(running.claim.name);
  for (const std::string& name : jobs_->ended_beyond(static_cast<std::size_t>(settings_.max_ended))) forget(name);
}

void Scheduler::forget(const std::string& name) {
  const auto removed = jobs_->remove(name);
  if (!removed) return;
  for (const std::string& digest : removed->digests) meshes_->release(digest);
  logs_.erase(name);
}

// ===== stopping =====

void Scheduler::stop() {
  std::lock_guard lock(mutex_);
  stopping_ = true;
  for (const auto& [name, running] : running_) running->cancelled = true;
}

bool Scheduler::drain(std::chrono::steady_clock::time_point deadline) {
  std::unique_lock lock(mutex_);
  return ended_.wait_until(lock, deadline, [this] { return inside_ == 0; });
}

}  // namespace varimesh::server
