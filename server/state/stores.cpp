// Chooses the stores and opens them. This is the one place that names them.
#include "server/state/stores.h"

#include <spdlog/spdlog.h>

#include <filesystem>
#include <set>
#include <system_error>

#include "core/base/sha256.h"
#include "server/jobs/sqlite_jobs.h"
#include "server/meshes/directory_mesh_store.h"
#include "server/meshes/disk.h"
#include "server/meshes/shared/shared_directory.h"
#include "server/state/owned_path.h"

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
  settings.max_bytes_of_owner = limits.max_bytes_per_owner;
  settings.lifetime = limits.mesh_lifetime;
  settings.compress_after = limits.compress_after;
  settings.log = [](const std::string& line) { spdlog::warn("{}", line); };
  return settings;
}

/// Refuses a state directory whose own file has jobs, which nobody would see while the jobs are in a database.
Expected<void> check_no_jobs(const StateDirectory& state) {
  if (!std::filesystem::exists(state.jobs())) return {};
  const auto jobs = open_sqlite_jobs(state.jobs());
  if (!jobs) return output_error(jobs.error());
  const auto page = (*jobs)->list({}, 1, "");
  if (!page) return output_error(page.error());
  if (page->jobs.empty()) return {};
  return tl::unexpected(Error{Error::Kind::Output, "The file " + state.jobs() +
                                                       " has jobs, which a server with --store does not see; start "
                                                       "without --store, or choose another directory for --state."});
}

/// Refuses meshes without the jobs that they are of: the server would delete them as nobody's.
Expected<void> check_not_lost(const StateDirectory& state) {
  if (has_sqlite_jobs(state.jobs())) return {};
  std::error_code error;
  for (std::filesystem::directory_iterator at(state.meshes(), error), end; !error && at != end; at.increment(error))
    if (is_sha256(at->path().stem().string()))
      return tl::unexpected(Error{
          Error::Kind::Output,
          "The directory '" + state.path().string() +
              "' has meshes, but its file jobs.sqlite is missing or empty, and without it the meshes would be deleted; "
              "restore the file from a backup. If the jobs are in a database, name it (--store). If the jobs are "
              "not needed, move the folder 'meshes' away."});
  return {};
}

/// Creates the directory that servers share, only for its owner, and returns its name.
Expected<std::string> take_shared(const std::string& directory) {
  const auto refuse = [&](const std::string& why) {
    return tl::unexpected(Error{Error::Kind::Output, "Cannot keep meshes in '" + directory + "': " + why +
                                                         "; choose another directory (--meshes)."});
  };
  std::error_code error;
  if (!std::filesystem::exists(directory, error)) {
    std::filesystem::create_directories(directory, error);
    if (error) return refuse(error.message());
    std::filesystem::permissions(directory, std::filesystem::perms::owner_all, error);
  }
  if (const std::string why = why_not_owned(directory, true); !why.empty()) return refuse(why);
  const auto name = name_of_directory(directory);
  if (!name) return output_error(name.error());
  return *name;
}

}  // namespace

Expected<void> Stores::open_jobs(const StoreSettings& settings) {
  JobStoreSettings job_settings;
  job_settings.clock = settings.clock;
  job_settings.lease = settings.limits.lease;
  job_settings.max_running_of_peer = settings.limits.max_running_jobs_per_peer;
  if (state_ == nullptr) {
    jobs_ = jobs_in_memory(job_settings);
    return {};
  }
  if (settings.open_jobs) {
    if (const auto checked = check_no_jobs(*state_); !checked) return tl::unexpected(checked.error());
    const std::string meshes = settings.meshes.empty() ? state_->meshes() : settings.meshes;
    const auto name = settings.mesh_place != nullptr ? settings.mesh_place->name() : take_shared(meshes);
    if (!name) return tl::unexpected(name.error());
    job_settings.meshes = *name;
    job_settings.clock = nullptr;  // the database has a clock that all its servers share
    auto jobs = settings.open_jobs(job_settings);
    if (!jobs) return tl::unexpected(jobs.error());
    jobs_ = std::move(*jobs);
    return {};
  }
  if (const auto checked = check_not_lost(*state_); !checked) return checked;
  auto jobs = open_sqlite_jobs(state_->jobs(), job_settings);
  if (!jobs) return output_error(jobs.error());
  jobs_ = std::move(*jobs);
  return {};
}

Expected<void> Stores::open_meshes(const StoreSettings& settings) {
  const auto keep = [this](auto opened) -> Expected<void> {
    if (!opened) return output_error(opened.error());
    meshes_ = std::move(*opened);
    return {};
  };
  const DirectoryMeshSettings limits = mesh_settings(settings.limits);
  const bool are_shared = !settings.meshes.empty() || settings.mesh_place != nullptr;
  if (are_shared && limits.max_bytes_of_owner > 0)
    return bad_option(
        "--max-bytes-per-owner cannot be kept with --meshes, since no server knows what all others store.");
  const AskNeeded needed = [this](const auto& digests) { return jobs_->referenced(digests); };
  if (settings.mesh_place != nullptr) {
    auto opened = settings.mesh_place->open(state_->meshes(), limits, needed);
    if (!opened) return tl::unexpected(opened.error());
    meshes_ = std::move(*opened);
    return {};
  }
  if (!settings.meshes.empty()) return keep(open_shared_directory(settings.meshes, state_->meshes(), limits, needed));
  if (state_ != nullptr) return keep(DirectoryMeshStore::open_directory(state_->meshes(), limits));
  return keep(DirectoryMeshStore::create(settings.data, limits));
}

Expected<std::unique_ptr<Stores>> Stores::open(const StoreSettings& settings) {
  std::unique_ptr<Stores> stores(new Stores);
  if (!settings.state.empty()) {
    auto directory = StateDirectory::take(settings.state);
    if (!directory) return tl::unexpected(directory.error());
    stores->state_ = std::move(*directory);
    stores->state_->become_server();
  }
  if (const auto opened = stores->open_jobs(settings); !opened) return tl::unexpected(opened.error());
  if (const auto opened = stores->open_meshes(settings); !opened) return tl::unexpected(opened.error());
  if (const auto read = stores->read_secret(settings); !read) return tl::unexpected(read.error());
  return stores;
}

Expected<void> Stores::read_secret(const StoreSettings& settings) {
  if (settings.mesh_place != nullptr) {
    const auto secret = settings.mesh_place->secret();
    if (!secret) return tl::unexpected(secret.error());
    secret_ = *secret;
  } else if (!settings.meshes.empty()) {
    secret_ = secret_in(settings.meshes);
  } else {
    secret_ = state_ != nullptr ? secret_in(state_->path()) : random_bytes();
  }
  return {};
}

}  // namespace varimesh::server
