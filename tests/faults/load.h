// What the parts of the load program share: clients of the real server, figures, and verdicts.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "tests/faults/real_server.h"
#include "varimesh/v1/service.grpc.pb.h"

namespace varimesh::server::testing {

using Clock = std::chrono::steady_clock;

/// Counts what did not hold, and prints every line.
class Verdict {
 public:
  /// `judges_figures`: whether a figure beyond its limit counts, as it does on a machine that does nothing else.
  explicit Verdict(bool judges_figures) : judges_figures_(judges_figures) {}
  void expect(bool held, const std::string& what);
  /// A figure and what it must not exceed.
  void expect_at_most(double figure, double limit, const std::string& unit, const std::string& what);
  bool all_held() const { return violations_ == 0; }

 private:
  const bool judges_figures_;
  int violations_ = 0;
};

/// A connection of its own, and the calls that the programs need. Whatever goes wrong ends the program.
class Caller {
 public:
  explicit Caller(const std::shared_ptr<grpc::Channel>& channel)
      : jobs(v1::JobService::NewStub(channel)), meshes(v1::MeshService::NewStub(channel)) {}

  std::string upload(const std::string& bytes) const;
  std::string submit(const v1::JobSpec& spec) const;
  v1::Job get(const std::string& name) const;
  void cancel(const std::string& name) const;
  /// Asks every few milliseconds until the job is in one of these states; how long that took.
  double wait_for(const std::string& name, const std::vector<v1::JobState>& states, v1::Job* job = nullptr) const;

  std::unique_ptr<v1::JobService::Stub> jobs;
  std::unique_ptr<v1::MeshService::Stub> meshes;
};

std::string read_case(const std::string& name);
/// So many sweeps over the mesh, by one thread unless more are asked for.
v1::JobSpec sweeps(const std::string& digest, int iterations, int threads = 1);
double milliseconds_since(Clock::time_point begun);
/// The part-th of the values.
double quantile(std::vector<double> values, double part);
/// A line of /proc/PID/status, in KiB.
long memory_kib(pid_t process, const std::string& line);
struct Setting {
  bool short_form = false;
  std::string program;  ///< The server.
};
using Trial = std::function<void(const Setting&, Verdict&)>;
/// By name; each part of the program adds its own.
std::map<std::string, Trial> watching_trials();
std::map<std::string, Trial> job_trials();
std::map<std::string, Trial> mesh_trials();

}  // namespace varimesh::server::testing
