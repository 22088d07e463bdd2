// Leases: how a worker keeps its jobs, and how lost jobs are taken back.
#include <set>

#include "server/scheduling/scheduler.h"

namespace varimesh::server {

Answer<void> Scheduler::recover() {
  {
    std::lock_guard lock(mutex_);
    const auto references = jobs_->references();
    if (!references) return tl::unexpected(references.error());
    for (const Reference& reference : *references) {
      meshes_->retain(reference.digest);
      meshes_->grant(reference.digest, reference.owner);
    }
  }
  take_back(settings_.worker);
  return {};
}

void Scheduler::take_back(const std::string& worker) {
  std::lock_guard lock(mutex_);
  std::set<std::string> running_here;
  for (const auto& [name, running] : running_) running_here.insert(name);
  const auto taken = jobs_->take_back(worker, running_here);
  if (!taken) return settings_.log("jobs", "cannot be taken back: " + taken.error().sentence);
  for (const Changed& changed : *taken) {
    settings_.log(changed.job.name(), "was lost and is now " + v1::JobState_Name(changed.job.state()));
    publish(changed);
  }
}

void Scheduler::renew_leases() {
  std::vector<std::shared_ptr<Running>> all;
  {
    std::lock_guard lock(mutex_);
    for (const auto& [name, running] : running_) all.push_back(running);
  }
  for (const auto& running : all) {
    const auto cancel = jobs_->renew_lease(running->claim);
    if (!cancel) settings_.log(running->claim.name, "lease cannot be renewed: " + cancel.error().sentence);
    const bool lost =
        !cancel && (cancel.error().code == Failure::Code::Aborted || cancel.error().code == Failure::Code::DataLoss);
    if (lost || (cancel && *cancel)) running->cancelled = true;
  }
}

void Scheduler::tick() {
  if (stopping_) return;
  if (const SteadyTime now = settings_.steady(); now >= next_renewal_) {
    next_renewal_ = now + settings_.renewal_interval;
    renew_leases();
    take_back("");
    std::lock_guard lock(mutex_);
    forget_old();
  }
  start_jobs();
}

}  // namespace varimesh::server
