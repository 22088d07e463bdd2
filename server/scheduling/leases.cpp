// Leases: how a worker keeps its jobs, and how lost jobs are taken back.
#include <set>
#include <utility>

#include "server/scheduling/scheduler.h"

namespace varimesh::server {

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
  if (news.kind != News::Kind::Cancel) start_jobs();
}

void Scheduler::tick() {
  if (stopping_) return;
  if (!std::exchange(listening_, true)) jobs_->listen([this](const News& news) { hear(news); });
  if (const SteadyTime now = settings_.steady(); now >= next_renewal_) {
    next_renewal_ = now + settings_.renewal_interval;
    renew_leases();
    take_back("");
    forget_old();
  }
  if (jobs_->shared())
    for (const std::string& name : logs_.watched())
      if (!runs_here(name)) logs_.follow(name);
  start_jobs();
}

}  // namespace varimesh::server
