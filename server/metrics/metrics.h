// What the server counts, for Prometheus.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "server/webhooks/webhook_settings.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::server {

/// What is measured when somebody asks.
struct Gauges {
  int pending = 0, running = 0;                  ///< Jobs.
  std::optional<double> oldest_pending_seconds;  ///< Age of the job that has waited longest; nothing: not known.
  std::optional<std::int64_t> store_bytes;       ///< Of all meshes and results; nothing: another server counts them.
  int waiting_calls = 0;                         ///< Webhooks that are to be called, now or later.
  int devices = 0, busy_devices = 0;             ///< Devices for jobs; how many of them a job has.
  int jobs_on_devices = 0;                       ///< Jobs that have a device.
  bool ready = false;
};

/// The metrics of a server, all with base units and without names of jobs or owners:
///
///   varimesh_build_info{version}                          1
///   varimesh_ready                                        1 if the server accepts jobs
///   varimesh_jobs{state}                                  jobs that wait ("pending") and run ("running")
///   varimesh_queue_oldest_age_seconds                     age of the job that has waited longest; 0: none waits
///   varimesh_devices{state}                               devices for jobs that no job has ("free") and one has
///                                                         ("busy")
///   varimesh_jobs_on_devices                              jobs that have a device
///   varimesh_device_jobs_total                            jobs that have ended and had steps made by a device
///   varimesh_jobs_submitted_total                         jobs that were accepted
///   varimesh_job_run_seconds{outcome}                     histogram: run times of the last attempts, by how jobs ended
///   varimesh_job_wait_seconds                             histogram: from submission until the last attempt began, or
///                                                         until the job ended without one
///   varimesh_worker_cpu_seconds_total                     processor time of the processes of jobs that have ended
///   varimesh_jobs_lost_total                              jobs that were taken back from a server that was lost
///   varimesh_kernel_operations_total                      floating-point operations of the kernels of the energy, its
///                                                         gradient and its Hessian (core/kernels/operations.h)
///   varimesh_kernel_seconds_total                         seconds that threads have spent in these kernels
///   varimesh_mesh_bytes_total{direction}                  bytes of meshes and results that clients sent ("in") and got
///                                                         ("out")
///   varimesh_webhook_calls_total{outcome}                 calls at the end of jobs that were answered ("delivered"),
///                                                         failed and are tried again ("failed"), or given up
///                                                         ("given_up")
///   varimesh_webhooks_waiting                             webhooks that are to be called, now or later
///   varimesh_store_bytes                                  bytes of all meshes and results, from the server that sweeps
///   grpc_server_handled_total{grpc_service,grpc_method,grpc_code}   calls, by how they ended
///   grpc_server_handling_seconds{grpc_service,grpc_method}          histogram: how long calls took
///   process_resident_memory_bytes, process_open_fds, process_max_fds, process_cpu_seconds_total
///
/// Counters begin at 0 with the process. Thread-safe. In a build without prometheus-cpp nothing is counted.
class Metrics {
 public:
  Metrics();
  ~Metrics();
  Metrics(const Metrics&) = delete;
  Metrics& operator=(const Metrics&) = delete;

  /// Whether this build can count.
  static bool available();

  void count_submission();
  /// Counts a job that has ended.
  void count_end(const v1::Job& job);
  /// Counts a job that was taken back from a server that was lost.
  void count_loss();
  /// Counts a call at the end of a job.
  void count_webhook(CallEnd end);
  /// Counts floating-point operations of the kernels, and the seconds that threads have spent in them.
  void count_kernels(double operations, double seconds);
  /// Counts bytes of meshes that clients have sent or got.
  void count_bytes(bool sent_by_client, std::int64_t bytes);
  /// Counts a call, such as "/varimesh.v1.JobService/GetJob". `code`: gRPC's status code; `took`: until the status was
  /// sent.
  void count_call(std::string_view method, int code, std::chrono::duration<double> took);
  /// The text format of Prometheus, version 0.0.4. Empty if this build cannot count.
  std::string text(const Gauges& now);

 private:
  struct Families;
  const std::unique_ptr<Families> families_;
};

}  // namespace varimesh::server
