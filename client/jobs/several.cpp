#include "client/jobs/several.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "client/io/job_table.h"
#include "client/library/failures.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"

namespace varimesh::client {

// === Endings =============================================================================================

void Endings::add(const v1::Job& job) {
  if (job.state() == v1::JOB_STATE_FAILED)
    ++failed_;
  else if (job.state() == v1::JOB_STATE_CANCELLED)
    ++cancelled_;
  else
    ++(uncertified(job) == 0 ? valid_ : left_);
}

std::string Endings::sentence() const {
  const std::size_t all = valid_ + left_ + failed_ + cancelled_ + deleted_;
  std::string sentence = fmt::format("{} {} ended:", all, all == 1 ? "job" : "jobs");
  bool first = true;
  const auto add = [&](std::size_t number, const char* how) {
    if (number == 0) return;
    sentence += fmt::format("{} {} {}", first ? "" : ",", number, how);
    first = false;
  };
  add(valid_, "certified valid");
  add(left_, "with elements that are not certified valid");
  add(failed_, "failed");
  add(cancelled_, "cancelled");
  add(deleted_, "deleted by someone else");
  return sentence;
}

int Endings::exit_status() const {
  if (failed_ + cancelled_ + deleted_ > 0) return kJobFailed;
  return left_ > 0 ? kInvalidLeft : kDone;
}

// === Waiting =============================================================================================

void sleep_unless_interrupted(std::chrono::milliseconds time) {
  const auto end = std::chrono::steady_clock::now() + time;
  while (!interrupted() && std::chrono::steady_clock::now() < end)
    std::this_thread::sleep_for(std::min<std::chrono::steady_clock::duration>(std::chrono::milliseconds(50),
                                                                              end - std::chrono::steady_clock::now()));
}

Outcome<void> wait_for_ends(Client* client, const std::vector<v1::Job>& jobs, const Waiting& waiting) {
  using Clock = std::chrono::steady_clock;
  std::vector<std::string> open;
  for (const v1::Job& job : jobs)
    if (has_ended(job))
      waiting.on_end(job);
    else
      open.push_back(job.name());
  while (true) {
    if (waiting.on_look) waiting.on_look(jobs.size() - open.size(), jobs.size());
    if (open.empty()) return {};
    const auto begin = Clock::now();
    std::vector<std::string> still_open;
    for (const std::string& name : open) {
      if (interrupted()) return interruption("Interrupted before all jobs had ended.");
      const auto job = client->get(name);
      if (!job && job.error().reason == "JOB_NOT_FOUND")
        waiting.on_deleted(name);
      else if (!job)
        return tl::unexpected(job.error());
      else if (has_ended(*job))
        waiting.on_end(*job);
      else
        still_open.push_back(name);
    }
    open = std::move(still_open);
    if (open.empty()) continue;
    const auto took = std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - begin);
    sleep_unless_interrupted(std::max(std::chrono::milliseconds(300), 10 * took));
  }
}

}  // namespace varimesh::client
