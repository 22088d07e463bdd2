#include "client/io/job_table.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <google/protobuf/util/time_util.h>

#include <algorithm>
#include <ctime>
#include <map>

#include "client/cli/names.h"
#include "core/base/utf8.h"

namespace varimesh::client {
namespace {

/// The text in at most `width` columns, if each letter takes one.
std::string cut(const std::string& text, std::size_t width) {
  const auto is_start = [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; };
  if (static_cast<std::size_t>(std::ranges::count_if(text, is_start)) <= width) return text;
  std::size_t end = 0;
  for (std::size_t letters = 0; letters < width; ++end) letters += is_start(text[end]) ? 1 : 0;
  return text.substr(0, end - 1) + "…";
}

/// Below it, columns are narrow.
constexpr std::size_t kWide = 110;

/// The name of the job; in narrow columns its first eight digits, which every command takes.
std::string shown_name(const v1::Job& job, std::size_t width) {
  std::string name = as_plain_text(job.name());
  return width < kWide ? name.substr(name.find('/') + 1, 8) : name;
}

std::string row(std::size_t width, const std::string& job, const std::string& state, const std::string& submitted,
                const std::string& seconds, const std::string& iterations, const std::string& words) {
  std::string line =
      width < kWide
          ? fmt::format("{:<8}  {:<10}  {:<11}  {:>8}  {}", job, state, submitted, seconds, words)
          : fmt::format("{:<24}  {:<10}  {:<19}  {:>8}  {:>10}  {}", job, state, submitted, seconds, iterations, words);
  line.erase(line.find_last_not_of(' ') + 1);
  return cut(line, width) + "\n";
}

/// The time in the time zone of this machine: 2026-01-31 14:05:59, or 01-31 14:05 in narrow columns.
std::string local_time(const google::protobuf::Timestamp& time, std::size_t width) {
  const std::time_t seconds = time.seconds();
  std::tm parts{};
  if (seconds == 0 || localtime_r(&seconds, &parts) == nullptr) return "";
  return width < kWide ? fmt::format("{:%m-%d %H:%M}", parts) : fmt::format("{:%Y-%m-%d %H:%M:%S}", parts);
}

/// How long the job has run, in seconds; empty if it has not begun.
std::string time_run(const v1::Job& job) {
  if (!job.has_start_time()) return "";
  using google::protobuf::util::TimeUtil;
  const auto end = job.has_end_time() ? job.end_time() : TimeUtil::GetCurrentTime();
  return fmt::format("{:.1f} s", static_cast<double>(TimeUtil::DurationToMilliseconds(end - job.start_time())) / 1000);
}

}  // namespace

std::string job_heading(std::size_t width) {
  return row(width, "JOB", "STATE", "SUBMITTED", "RAN", "ITERATIONS", "FILE AND LABELS");
}

std::string job_row(const v1::Job& job, std::size_t width) {
  return row(width, shown_name(job, width), spelled(job.state()), local_time(job.create_time(), width), time_run(job),
             std::to_string(job.has_metrics() ? job.metrics().iterations() : job.iteration().number()),
             words_about(job));
}

std::string words_about(const v1::Job& job) {
  std::map<std::string, std::string> labels(job.spec().labels().begin(), job.spec().labels().end());
  std::string words = labels["file"];
  labels.erase("file");
  for (const auto& [key, value] : labels) words += (words.empty() ? "" : "  ") + key + "=" + value;
  return as_plain_text(words);
}

bool has_ended(const v1::Job& job) {
  return job.state() == v1::JOB_STATE_SUCCEEDED || job.state() == v1::JOB_STATE_FAILED ||
         job.state() == v1::JOB_STATE_CANCELLED;
}

bool has_result(const v1::Job& job) { return has_ended(job) && job.has_metrics() && job.results_size() > 0; }

std::int64_t uncertified(const v1::Job& job) {
  const v1::Certified& certified = job.metrics().after().certified();
  return certified.invalid() + certified.undecided();
}

std::string ending_of(const v1::Job& job) {
  if (job.has_error()) return as_plain_text(job.error().message());
  if (!job.has_metrics()) return job.state() == v1::JOB_STATE_CANCELLED ? "it had not begun" : "";
  const std::int64_t left = uncertified(job);
  const std::string figures = fmt::format("min Js {:.4f}", job.metrics().after().min_scaled_jacobian());
  if (left == 0) return figures + ", every element certified valid";
  return fmt::format("{}, {} {} not certified valid", figures, left, left == 1 ? "element" : "elements");
}

}  // namespace varimesh::client
