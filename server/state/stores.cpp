// Chooses the stores and opens them. This is the one place that names them.
#include "server/state/stores.h"

#include <spdlog/spdlog.h>

#include <filesystem>

#include "server/jobs/memory_job_store.h"
#include "server/jobs/sqlite_job_store.h"

namespace varimesh::server {
namespace {

tl::unexpected<Error> output_error(const Failure& failure) {
  return tl::unexpected(Error{Error::Kind::Output, failure.sentence});
}

DirectoryMeshSettings mesh_settings(const Limits& limits) {
  DirectoryMeshSettings settings;
  settings.max_mesh_bytes = limits.max_mesh_bytes;
  settings.max_memory_bytes = limits.max_memory_bytes;
  settings.max_total_bytes = limits.max_store_bytes;
  settings.reserve_bytes = limits.reserve_bytes;
  settings.lifetime = limits.mesh_lifetime;
  settings.compress_after = limits.compress_after;
  settings.log = [](const std::string& line) { spdlog::warn("{}", line); };
  return settings;
}

/// Refuses a state directory whose own file has jobs, which nobody would see while the jobs are in a database.
Expected<void> check_no_jobs(const StateDirectory& state) {
  if (!std::filesystem::exists(state.jobs())) return {};
  const auto jobs = SqliteJobStore::open(state.jobs());
  if (!jobs) return output_error(jobs.error());
  const auto page = (*jobs)->list({}, 1, "");
  if (!page) return output_error(page.error());
  if (page->jobs.empty()) return {};
  return tl::unexpected(Error{Error::Kind::Output, "The file " + state.jobs() +
                                                       " has jobs, which a server with --store does not see; start "
                                                       "without --store, or choose another directory for --state."});
}

Expected<std::unique_ptr<JobStore>> open_jobs(const StoreSettings& settings, const StateDirectory& state,
                                              JobStoreSettings job_settings) {
  if (settings.open_jobs) {
    if (const auto checked = check_no_jobs(state); !checked) return tl::unexpected(checked.error());
    job_settings.clock = nullptr;  // the database has a clock that all its servers share
    return settings.open_jobs(job_settings);
  }
  auto jobs = SqliteJobStore::open(state.jobs(), job_settings);
  if (!jobs) return output_error(jobs.error());
  return std::unique_ptr<JobStore>(std::move(*jobs));
}

}  // namespace

Expected<std::unique_ptr<Stores>> Stores::open(const StoreSettings& settings) {
  std::unique_ptr<Stores> stores(new Stores);
  JobStoreSettings job_settings;
  job_settings.clock = settings.clock;
  job_settings.lease = settings.limits.lease;
  job_settings.max_running_of_peer = settings.limits.max_running_jobs_per_peer;
  if (settings.state.empty()) {
    stores->jobs_ = std::make_unique<MemoryJobStore>(job_settings);
  } else {
    auto directory = StateDirectory::take(settings.state);
    if (!directory) return tl::unexpected(directory.error());
    stores->state_ = std::move(*directory);
    auto jobs = open_jobs(settings, *stores->state_, job_settings);
    if (!jobs) return tl::unexpected(jobs.error());
    stores->jobs_ = std::move(*jobs);
  }
  auto meshes = stores->state_ != nullptr
                    ? DirectoryMeshStore::open_directory(stores->state_->meshes(), mesh_settings(settings.limits))
                    : DirectoryMeshStore::create(settings.data, mesh_settings(settings.limits));
  if (!meshes) return output_error(meshes.error());
  stores->meshes_ = std::move(*meshes);
  return stores;
}

}  // namespace varimesh::server
