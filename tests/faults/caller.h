// A client of the real server, and small helpers that the programs share.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tests/faults/real_server.h"
#include "varimesh/v1/service.grpc.pb.h"

namespace varimesh::server::testing {

using Clock = std::chrono::steady_clock;

/// A connection and the calls that the programs need. All calls wait until the server is there. Those without a status
/// print a violation and end the program if the call fails.
class Caller {
 public:
  explicit Caller(const std::shared_ptr<grpc::Channel>& channel)
      : jobs(v1::JobService::NewStub(channel)), meshes(v1::MeshService::NewStub(channel)) {}

  /// Uploads a mesh and sets its digest.
  grpc::Status try_upload(const std::string& bytes, std::string* digest) const;
  /// Submits a job and sets its name.
  grpc::Status try_submit(const v1::JobSpec& spec, std::string* name) const;

  std::string upload(const std::string& bytes) const;
  std::string submit(const v1::JobSpec& spec) const;
  v1::Job get(const std::string& name) const;
  void cancel(const std::string& name) const;
  void remove(const std::string& name) const;
  /// Asks every few milliseconds until the job is in one of these states, for at most five minutes. Returns how long
  /// that took, in milliseconds.
  double wait_for(const std::string& name, const std::vector<v1::JobState>& states, v1::Job* job = nullptr) const;
  /// Asks every few milliseconds until the job has done an iteration, for at most five minutes.
  void wait_for_an_iteration(const std::string& name) const;

  std::unique_ptr<v1::JobService::Stub> jobs;
  std::unique_ptr<v1::MeshService::Stub> meshes;

 private:
  double wait_until(const std::string& name, const std::function<bool(const v1::Job&)>& reached) const;
};

/// Returns the bytes of a file; empty if it cannot be read.
std::string read_file(const std::string& path);
/// Returns the bytes of a file in tests/cases.
std::string read_case(const std::string& name);
/// A job of exactly this many sweeps over the mesh.
v1::JobSpec sweeps(const std::string& digest, int iterations, int threads = 1);
double milliseconds_since(Clock::time_point begun);
/// Returns a quantile of the values; 0 if there are none. `part` from 0 (the smallest) to 1 (the largest).
double quantile(std::vector<double> values, double part);
/// Returns the value of a line of /proc/PID/status, in KiB.
long memory_kib(pid_t process, const std::string& line);

}  // namespace varimesh::server::testing
