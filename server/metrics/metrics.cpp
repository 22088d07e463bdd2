// The metrics, with prometheus-cpp.
#include "server/metrics/metrics.h"

#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <cctype>
#include <filesystem>
#include <fstream>

#include "core/base/version.h"
#include "server/jobs/timestamps.h"

namespace varimesh::server {
namespace {

using prometheus::Counter;
using prometheus::Family;
using prometheus::Gauge;
using prometheus::Histogram;
using prometheus::Registry;

Family<Gauge>& gauges(Registry& registry, const std::string& name, const std::string& help) {
  return prometheus::BuildGauge().Name(name).Help(help).Register(registry);
}

Family<Counter>& counters(Registry& registry, const std::string& name, const std::string& help) {
  return prometheus::BuildCounter().Name(name).Help(help).Register(registry);
}

/// From a tenth of a second to a day.
const Histogram::BucketBoundaries kRunSeconds{0.1, 0.3, 1, 3, 10, 30, 60, 300, 1800, 3600, 4 * 3600, 24 * 3600};

/// From a millisecond to a minute. Watches and other streams take longer.
const Histogram::BucketBoundaries kCallSeconds{0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1, 3, 10, 60};

Family<Histogram>& histograms(Registry& registry, const std::string& name, const std::string& help) {
  return prometheus::BuildHistogram().Name(name).Help(help).Register(registry);
}

constexpr std::array kCodes{
    "OK",        "CANCELLED",      "UNKNOWN",           "INVALID_ARGUMENT",   "DEADLINE_EXCEEDED",
    "NOT_FOUND", "ALREADY_EXISTS", "PERMISSION_DENIED", "RESOURCE_EXHAUSTED", "FAILED_PRECONDITION",
    "ABORTED",   "OUT_OF_RANGE",   "UNIMPLEMENTED",     "INTERNAL",           "UNAVAILABLE",
    "DATA_LOSS", "UNAUTHENTICATED"};

/// "succeeded" of JOB_STATE_SUCCEEDED.
std::string outcome_of(v1::JobState state) {
  std::string name = v1::JobState_Name(state).substr(std::string_view("JOB_STATE_").size());
  for (char& c : name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return name;
}

double resident_bytes() {
  std::ifstream file("/proc/self/statm");
  double all = 0, resident = 0;
  file >> all >> resident;
  return resident * static_cast<double>(::sysconf(_SC_PAGESIZE));
}

double open_descriptors() {
  std::error_code error;
  double count = -1;  // the one that reads the folder
  for ([[maybe_unused]] const auto& one : std::filesystem::directory_iterator("/proc/self/fd", error)) ++count;
  return error ? 0 : count;
}

/// RUSAGE_SELF: of this process; RUSAGE_CHILDREN: of its processes that have ended.
double processor_seconds(int whose) {
  rusage usage{};
  ::getrusage(whose, &usage);
  const auto seconds = [](const timeval& time) { return static_cast<double>(time.tv_sec) + 1e-6 * time.tv_usec; };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace

struct Metrics::Families {
  Registry registry;
  Gauge& ready = gauges(registry, "varimesh_ready", "1 if the server accepts jobs.").Add({});
  Family<Gauge>& jobs = gauges(registry, "varimesh_jobs", "Jobs that wait and run.");
  Gauge& pending = jobs.Add({{"state", "pending"}});
  Gauge& running = jobs.Add({{"state", "running"}});
  Family<Gauge>& oldest =
      gauges(registry, "varimesh_queue_oldest_age_seconds", "Age of the job that has waited longest.");
  Family<Gauge>& devices = gauges(registry, "varimesh_devices", "Devices for jobs.");
  Gauge& free_devices = devices.Add({{"state", "free"}});
  Gauge& busy_devices = devices.Add({{"state", "busy"}});
  Gauge& jobs_on_devices = gauges(registry, "varimesh_jobs_on_devices", "Jobs that have a device.").Add({});
  Counter& device_jobs =
      counters(registry, "varimesh_device_jobs_total", "Jobs that have ended and had steps made by a device.").Add({});
  Counter& submitted = counters(registry, "varimesh_jobs_submitted_total", "Jobs that were accepted.").Add({});
  Family<Histogram>& run_seconds = histograms(registry, "varimesh_job_run_seconds",
                                              "Run times of the last attempts of jobs, by how the jobs ended.");
  Histogram& wait_seconds = histograms(registry, "varimesh_job_wait_seconds",
                                       "Times from the submission of jobs until their last attempts began.")
                                .Add({}, kRunSeconds);
  Counter& lost =
      counters(registry, "varimesh_jobs_lost_total", "Jobs that were taken back from a server that was lost.").Add({});
  Family<Counter>& webhook_calls =
      counters(registry, "varimesh_webhook_calls_total", "Calls at the end of jobs, by how they ended.");
  std::array<Counter*, 3> call_ends{&webhook_calls.Add({{"outcome", "delivered"}}),
                                    &webhook_calls.Add({{"outcome", "failed"}}),
                                    &webhook_calls.Add({{"outcome", "given_up"}})};
  Gauge& waiting_calls =
      gauges(registry, "varimesh_webhooks_waiting", "Webhooks that are to be called, now or later.").Add({});
  Counter& kernel_operations = counters(registry, "varimesh_kernel_operations_total",
                                        "Floating-point operations of the kernels of the energy and its derivatives.")
                                   .Add({});
  Counter& kernel_seconds =
      counters(registry, "varimesh_kernel_seconds_total", "Seconds that threads have spent in these kernels.").Add({});
  Family<Counter>& bytes =
      counters(registry, "varimesh_mesh_bytes_total", "Bytes of meshes and results that clients sent and got.");
  Counter& bytes_in = bytes.Add({{"direction", "in"}});
  Counter& bytes_out = bytes.Add({{"direction", "out"}});
  Family<Gauge>& stored = gauges(registry, "varimesh_store_bytes", "Bytes of all meshes and results.");
  Family<Counter>& handled = counters(registry, "grpc_server_handled_total", "Calls, by how they ended.");
  Gauge& resident = gauges(registry, "process_resident_memory_bytes", "Resident memory.").Add({});
  Gauge& descriptors = gauges(registry, "process_open_fds", "Open descriptors.").Add({});
  Gauge& most_descriptors = gauges(registry, "process_max_fds", "The limit of open descriptors.").Add({});
  Family<Histogram>& handling = histograms(registry, "grpc_server_handling_seconds", "How long calls took.");
  Counter& workers = counters(registry, "varimesh_worker_cpu_seconds_total",
                              "Processor time of the processes of jobs that have ended.")
                         .Add({});
  Counter& processor = counters(registry, "process_cpu_seconds_total", "Processor time.").Add({});
};

Metrics::Metrics() : families_(std::make_unique<Families>()) {
  gauges(families_->registry, "varimesh_build_info", "The version of the server.")
      .Add({{"version", std::string(version())}})
      .Set(1);
}

Metrics::~Metrics() = default;

bool Metrics::available() { return true; }

void Metrics::count_submission() { families_->submitted.Increment(); }

void Metrics::count_end(const v1::Job& job) {
  const auto seconds = [](const auto& from, const auto& to) {
    return std::max(0.0, std::chrono::duration<double>(time_point(to) - time_point(from)).count());
  };
  const auto& began = job.has_start_time() ? job.start_time() : job.end_time();
  families_->run_seconds.Add({{"outcome", outcome_of(job.state())}}, kRunSeconds)
      .Observe(seconds(began, job.end_time()));
  families_->wait_seconds.Observe(seconds(job.create_time(), began));
  if (!job.metrics().device().empty()) families_->device_jobs.Increment();
}

void Metrics::count_loss() { families_->lost.Increment(); }

void Metrics::count_webhook(CallEnd end) { families_->call_ends[static_cast<std::size_t>(end)]->Increment(); }

void Metrics::count_kernels(double operations, double seconds) {
  families_->kernel_operations.Increment(operations);
  families_->kernel_seconds.Increment(seconds);
}

void Metrics::count_bytes(bool sent_by_client, std::int64_t bytes) {
  (sent_by_client ? families_->bytes_in : families_->bytes_out).Increment(static_cast<double>(bytes));
}

void Metrics::count_call(std::string_view method, int code, std::chrono::duration<double> took) {
  const auto slash = method.rfind('/');
  if (slash == std::string_view::npos || slash == 0) return;
  const bool is_known = code >= 0 && code < static_cast<int>(kCodes.size());
  const std::string service(method.substr(1, slash - 1)), name(method.substr(slash + 1));
  const char* const ended = is_known ? kCodes[static_cast<std::size_t>(code)] : "UNKNOWN";
  families_->handled.Add({{"grpc_service", service}, {"grpc_method", name}, {"grpc_code", ended}}).Increment();
  families_->handling.Add({{"grpc_service", service}, {"grpc_method", name}}, kCallSeconds).Observe(took.count());
}

std::string Metrics::text(const Gauges& now) {
  Families& all = *families_;
  all.ready.Set(now.ready ? 1 : 0);
  all.pending.Set(now.pending);
  all.running.Set(now.running);
  all.waiting_calls.Set(now.waiting_calls);
  all.free_devices.Set(now.devices - now.busy_devices);
  all.busy_devices.Set(now.busy_devices);
  all.jobs_on_devices.Set(now.jobs_on_devices);
  if (now.store_bytes) all.stored.Add({}).Set(static_cast<double>(*now.store_bytes));
  if (now.oldest_pending_seconds) all.oldest.Add({}).Set(*now.oldest_pending_seconds);
  all.resident.Set(resident_bytes());
  all.descriptors.Set(open_descriptors());
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) == 0) all.most_descriptors.Set(static_cast<double>(limit.rlim_cur));
  all.processor.Increment(std::max(0.0, processor_seconds(RUSAGE_SELF) - all.processor.Value()));
  all.workers.Increment(std::max(0.0, processor_seconds(RUSAGE_CHILDREN) - all.workers.Value()));
  return prometheus::TextSerializer().Serialize(all.registry.Collect());
}

}  // namespace varimesh::server
