// Converts jobs and iterations to JSON.
#include "server/admin/live_status.h"

#include <algorithm>
#include <cctype>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/base/version.h"
#include "server/jobs/event_log.h"
#include "server/jobs/job_record.h"
#include "server/jobs/timestamps.h"

namespace varimesh::server {
namespace {

using Json = nlohmann::ordered_json;

/// Whether the page offers to cancel jobs.
bool may_cancel(const CallersView& view) {
  return !view.caller().owner.empty() && view.caller().rights.contains(kCancel);
}

/// Removes the prefix of an enum's name, so that "JOB_STATE_RUNNING" becomes "running".
std::string lower(std::string name, std::size_t prefix) {
  name.erase(0, std::min(prefix, name.size()));
  for (char& c : name) c = c == '_' ? '-' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return name;
}

std::string spelled(v1::JobState state) { return lower(v1::JobState_Name(state), sizeof "JOB_STATE_" - 1); }
std::string spelled(v1::Phase phase) { return lower(v1::Phase_Name(phase), sizeof "PHASE_" - 1); }
std::string spelled(v1::Energy energy) {
  return energy == v1::ENERGY_UNSPECIFIED ? "" : lower(v1::Energy_Name(energy), sizeof "ENERGY_" - 1);
}

std::int64_t milliseconds(TimePoint time) {
  return std::chrono::duration_cast<std::chrono::milliseconds>(time.time_since_epoch()).count();
}

Json time_or_null(bool there, const google::protobuf::Timestamp& time) {
  return there ? Json(milliseconds(time_point(time))) : Json();
}

Json iteration_row(const v1::Iteration& one) {
  return {one.number(), spelled(one.phase()), one.energy(), one.residual(), one.min_scaled_jacobian(), one.seconds()};
}

Json job_document(const v1::Job& job) {
  Json document = {{"job", job.name()},
                   {"state", spelled(job.state())},
                   {"labels", Json::object()},
                   {"priority", job.spec().priority()},
                   {"attempt", job.attempt()},
                   {"energy", spelled(job.spec().options().energy())},
                   {"submitted", time_or_null(job.has_create_time(), job.create_time())},
                   {"began", time_or_null(job.has_start_time(), job.start_time())},
                   {"ended", time_or_null(job.has_end_time(), job.end_time())}};
  if (!job.owner().empty()) document["owner"] = job.owner();
  for (const auto& [key, value] : job.spec().labels()) document["labels"][key] = value;
  if (job.has_iteration()) {
    document["iteration"] = iteration_row(job.iteration());
    document["invalid"] = job.iteration().invalid_elements();
  }
  if (job.has_metrics()) {
    const v1::Metrics& metrics = job.metrics();
    document["iterations"] = metrics.iterations();
    document["elements"] = metrics.mesh().elements();
    document["min_scaled_jacobian"] = {metrics.before().min_scaled_jacobian(), metrics.after().min_scaled_jacobian()};
    document["not_certified"] = metrics.after().certified().invalid() + metrics.after().certified().undecided();
  }
  if (job.has_error()) document["error"] = job.error().message();
  return document;
}

/// Replaces invalid bytes, since labels and messages may contain any bytes and JSON must be UTF-8.
std::string printed(const Json& document) { return document.dump(-1, ' ', false, Json::error_handler_t::replace); }

}  // namespace

Answer<std::string> LiveStatus::status(const CallersView& view) {
  const std::lock_guard lock(mutex_);
  const auto now = std::chrono::steady_clock::now();
  std::erase_if(made_, [&](const auto& made) { return now - made.second.time >= kStatusInterval; });
  // No name of an owner has a line end.
  const std::string owner = (view.caller().sees_all() ? "" : view.caller().owner) + (may_cancel(view) ? "\n" : "");
  auto made = made_.find(owner);
  if (made == made_.end()) {
    Answer<std::string> status = make_status(view);
    made = made_.emplace(owner, Made{std::chrono::steady_clock::now(), std::move(status)}).first;
  }
  return made->second.status;
}

Answer<std::string> LiveStatus::make_status(const CallersView& view) const {
  const auto counts = scheduler_->counts();
  if (!counts) return tl::unexpected(counts.error());
  constexpr int kAll = 1000;
  constexpr std::size_t kAllBytes = std::numeric_limits<std::size_t>::max();
  auto running = view.list({{v1::JOB_STATE_RUNNING, v1::JOB_STATE_CANCELLING}, {}, kAllBytes}, kAll, "");
  auto pending = view.list({{v1::JOB_STATE_PENDING}, {}, kAllBytes}, kAll, "");
  auto ended = view.list({{v1::JOB_STATE_SUCCEEDED, v1::JOB_STATE_FAILED, v1::JOB_STATE_CANCELLED}, {}, kAllBytes},
                         kMostEnded, "");
  // The store lists the newest first, but of jobs with equal turns the oldest runs first.
  if (pending) {
    std::reverse(pending->jobs.begin(), pending->jobs.end());
    std::stable_sort(pending->jobs.begin(), pending->jobs.end(),
                     [](const v1::Job& a, const v1::Job& b) { return turn_of(a) < turn_of(b); });
  }
  Json jobs = Json::array();
  for (const auto* page : {&running, &pending, &ended}) {
    if (!*page) return tl::unexpected(page->error());
    for (const v1::Job& job : (*page)->jobs) jobs.push_back(job_document(job));
  }
  return printed({{"version", std::string(version())},
                  {"start_time", milliseconds(start_)},
                  {"time", milliseconds(clock_())},
                  {"threads", limits_.threads},
                  {"max_pending_jobs", limits_.max_pending_jobs},
                  {"pending", counts->pending},
                  {"running", counts->running},
                  {"may_cancel", may_cancel(view)},
                  {"jobs", std::move(jobs)}});
}

Answer<std::string> LiveStatus::iterations(const CallersView& view, const std::string& job, std::int64_t after) {
  const auto log = view.events(job);
  if (!log) return tl::unexpected(log.error());
  // Iterations that the log has dropped are skipped, as for any watcher that is behind.
  constexpr int kMost = 4096;
  Json rows = Json::array();
  std::int64_t sequence = std::max<std::int64_t>(after, 0);
  auto next = EventLog::Next::Event;
  for (int i = 0; i < kMost; ++i) {
    v1::JobEvent event;
    next = (*log)->next(sequence, std::chrono::nanoseconds(0), {}, &event);
    if (next != EventLog::Next::Event) break;
    sequence = event.sequence();
    if (event.has_iteration()) rows.push_back(iteration_row(event.iteration()));
  }
  return printed({{"sequence", sequence}, {"ended", next == EventLog::Next::End}, {"iterations", std::move(rows)}});
}

}  // namespace varimesh::server
