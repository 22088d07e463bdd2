// Leases: how a worker claims jobs and keeps them, and how lost jobs are taken back.
#include <algorithm>
#include <set>
#include <utility>

#include "server/engine/translate.h"
#include "server/scheduling/run_device.h"
#include "server/scheduling/scheduler.h"

namespace varimesh::server {

// ===== claims =====

bool Scheduler::needs_device(const v1::JobSpec& spec) const {
  const auto options = options_from(spec.options());
  return options && device_asked_for(spec, *options, engine_) == DeviceChoice::Gpu;
}

bool Scheduler::takes_job_for_device() const {
  // Nobody else takes the jobs of a store that is not shared. One that needs a device then waits here, or has none.
  if (!jobs_->shared()) return true;
  const auto needing = std::ranges::count_if(running_, [](const auto& entry) { return entry.second->needs_device; });
  const std::int64_t taken = std::max<std::int64_t>(needing, devices_.jobs());  // jobs with auto have places too
  return taken + claiming_for_device_ < devices_.most_jobs();
}

std::shared_ptr<Scheduler::Running> Scheduler::claim() {
  ClaimFilter filter;
  {
    std::lock_guard lock(mutex_);
    // A job that waits for memory has no thread. Who has such jobs gets no others in their places.
    const int claimed = static_cast<int>(running_.size()) + claiming_;
    filter.only_first = claimed >= settings_.threads;
    if (stopping_ || claimed - resting_ >= settings_.threads || claimed >= 2 * settings_.threads) return nullptr;
    filter.needs_no_device = !takes_job_for_device();
    if (!filter.needs_no_device) ++claiming_for_device_;
    ++claiming_;
    ++inside_;
  }
  auto claimed = jobs_->claim(settings_.worker, filter);
  if (!claimed) settings_.log("jobs", "cannot be claimed: " + claimed.error().sentence);
  std::shared_ptr<Running> running;
  if (claimed && *claimed) {
    running = std::make_shared<Running>();
    running->claim = std::move((*claimed)->claim);
    running->needs_device = needs_device(running->claim.spec);
    running->log = logs_.claimed(running->claim.name, std::move((*claimed)->events));
  }
  std::lock_guard lock(mutex_);
  --claiming_;
  if (!filter.needs_no_device) --claiming_for_device_;
  if (running == nullptr) {
    --inside_;
    ended_.notify_all();
    return nullptr;
  }
  running_[running->claim.name] = running;
  // A cancel request that came before this line has not found the job among the running ones.
  if (running->log->state() == v1::JOB_STATE_CANCELLING || (stopping_ && !jobs_->durable())) running->cancelled = true;
  return running;
}

void Scheduler::start_jobs() {
  while (true) {
    const std::shared_ptr<Running> running = claim();
    if (running == nullptr) return;
    const int asked = running->claim.spec.options().threads();
    settings_.launch(asked > 0 ? std::min(asked, settings_.threads) : settings_.threads,
                     [this, running](const LentThreads& threads) { run(running, threads); });
  }
}

// ===== devices =====

void Scheduler::note_devices(bool lends) {
  if (devices_.devices() == 0) return;
  const auto noted = jobs_->note_devices(settings_.worker, lends ? own_devices() : LentDevices());
  if (!noted) settings_.log("jobs", "cannot be told of devices: " + noted.error().sentence);
}

LentDevices Scheduler::own_devices() const {
  return {devices_.devices(), devices_.busy(), devices_.jobs(), settings_.device_names};
}

LentDevices Scheduler::lent_devices() {
  if (!jobs_->shared()) return own_devices();
  return jobs_->lent_devices().value_or(own_devices());
}

void Scheduler::tell_of_missing_devices() {
  const auto told = jobs_->tell_of_missing_devices();
  if (!told) return settings_.log("jobs", "cannot be told that no device is there: " + told.error().sentence);
  for (const Changed& changed : *told) logs_.publish(changed);
}

// ===== leases =====

Answer<void> Scheduler::recover() {
  if (meshes_->counts_references()) {
    const auto references = jobs_->references();
    if (!references) return tl::unexpected(references.error());
    for (const Reference& reference : *references) {
      meshes_->retain(reference.digest);
      owned_.add(reference.owner, {reference.digest});
    }
  }
  take_back(settings_.worker);
  return {};
}

void Scheduler::take_back(const std::string& worker) {
  std::set<std::string> running_here;
  {
    std::lock_guard lock(mutex_);
    for (const auto& [name, running] : running_) running_here.insert(name);
  }
  const auto taken = jobs_->take_back(worker, running_here);
  if (!taken) return settings_.log("jobs", "cannot be taken back: " + taken.error().sentence);
  for (const Changed& changed : *taken) {
    settings_.log(changed.job.name(), "was lost and is now " + v1::JobState_Name(changed.job.state()));
    settings_.lost();
    logs_.publish(changed);
    release(changed.released);
    note_end(changed.job);
  }
}

void Scheduler::renew_leases() {
  std::vector<std::shared_ptr<Running>> all;
  {
    std::lock_guard lock(mutex_);
    for (const auto& [name, running] : running_) all.push_back(running);
  }
  for (const auto& running : all) renew_lease(*running);
}

void Scheduler::renew_lease(Running& running) {
  const Claim& claim = running.claim;
  const auto cancel = jobs_->renew_lease(claim);
  if (!cancel) settings_.log(claim.name, "lease cannot be renewed: " + cancel.error().sentence);
  const bool lost =
      !cancel && (cancel.error().code == Failure::Code::Aborted || cancel.error().code == Failure::Code::DataLoss);
  if (cancel && *cancel && running.log->state() != v1::JOB_STATE_CANCELLING) {
    const auto seen = change(claim.name, [&](std::int64_t last) { return jobs_->see_cancel(claim, last); });
    if (!seen) settings_.log(claim.name, "cannot record its cancel request: " + seen.error().sentence);
  }
  if (lost || (cancel && *cancel)) running.cancelled = true;
}

void Scheduler::hear(const News& news) {
  if (stopping_) return;
  if (news.kind == News::Kind::Changed) {
    if (!runs_here(news.job)) logs_.follow(news.job);
    return;
  }
  std::vector<std::shared_ptr<Running>> running;
  {
    std::lock_guard lock(mutex_);
    for (const auto& [name, one] : running_)
      if (news.kind == News::Kind::Reconnected || (news.kind == News::Kind::Cancel && news.job == name))
        running.push_back(one);
  }
  for (const auto& one : running) renew_lease(*one);
  if (news.kind == News::Kind::Reconnected) note_devices(true);
  if (news.kind != News::Kind::Cancel) start_jobs();
}

void Scheduler::tick() {
  if (stopping_) return;
  if (!std::exchange(listening_, true)) jobs_->listen([this](const News& news) { hear(news); });
  if (const SteadyTime now = settings_.steady(); now >= next_renewal_) {
    next_renewal_ = now + settings_.renewal_interval;
    renew_leases();
    note_devices(true);
    take_back("");
    tell_of_missing_devices();
    forget_old();
  }
  if (jobs_->shared())
    for (const std::string& name : logs_.watched())
      if (!runs_here(name)) logs_.follow(name);
  start_jobs();
}

}  // namespace varimesh::server
