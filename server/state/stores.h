// Everything that a server keeps: jobs, meshes and results.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "core/base/error.h"
#include "server/jobs/job_store.h"
#include "server/limits.h"
#include "server/meshes/mesh_place.h"
#include "server/state/state_directory.h"

namespace varimesh::server {

/// Where the stores are.
struct StoreSettings {
  /// A directory of jobs and meshes that outlive the server. Empty: both are deleted when the server ends.
  std::string state;
  /// If `state` is empty: the directory in which the temporary directory for meshes is created. Empty: the system's
  /// directory for temporary files.
  std::string data;
  /// With `open_jobs`: a directory of meshes that other servers use at the same time. Empty: they are in `state`.
  std::string meshes;
  /// With `open_jobs`: as `meshes`, but elsewhere than in a directory.
  std::shared_ptr<MeshPlace> mesh_place;
  Limits limits;
  std::function<TimePoint()> clock;
  /// Opens a job store elsewhere, for jobs that are not in `state`. Empty: they are there.
  std::function<Expected<std::unique_ptr<JobStore>>(const JobStoreSettings&)> open_jobs;
};

/// Owns the stores, and the state directory if there is one.
class Stores {
 public:
  /// Errors: Output if a directory or database cannot be used, or if another server uses the state directory.
  static Expected<std::unique_ptr<Stores>> open(const StoreSettings& settings);

  JobStore& jobs() { return *jobs_; }
  MeshStore& meshes() { return *meshes_; }
  /// 16 random bytes that nobody else knows: the same for all servers on a state directory, or on a directory of meshes
  /// that they share.
  const std::string& secret() const { return secret_; }

 private:
  Stores() = default;
  Expected<void> open_jobs(const StoreSettings& settings);
  Expected<void> open_meshes(const StoreSettings& settings);
  Expected<void> read_secret(const StoreSettings& settings);

  std::unique_ptr<StateDirectory> state_;  ///< Null if nothing outlives the server.
  std::string secret_;
  std::unique_ptr<JobStore> jobs_;
  std::unique_ptr<MeshStore> meshes_;  ///< May ask the jobs which meshes they need.
};

}  // namespace varimesh::server
