// Loads, extends and drops event logs.
#include "server/scheduling/job_logs.h"

#include <algorithm>

#include "server/jobs/timestamps.h"

namespace varimesh::server {
namespace {

/// How many event logs of ended jobs stay in memory, with all their iterations.
constexpr std::size_t kEndedLogs = 100;

}  // namespace

Answer<std::shared_ptr<EventLog>> JobLogs::of(const std::string& name) {
  while (true) {
    std::shared_ptr<Entry> entry;
    {
      std::lock_guard lock(mutex_);
      std::shared_ptr<Entry>& kept = entries_[name];
      if (kept == nullptr) kept = std::make_shared<Entry>();
      entry = kept;
    }
    std::lock_guard loading(entry->loading);
    if (entry->state == Entry::State::Failed) continue;  // another thread has tried and dropped this entry
    if (entry->state == Entry::State::Loaded) return entry->log;
    auto events = jobs_->events(name);
    if (events) {
      entry->log->append_stored([&](std::int64_t) { return std::move(*events); });
      entry->state = Entry::State::Loaded;
      close_ended(name, *entry->log);
      return entry->log;
    }
    entry->state = Entry::State::Failed;
    std::lock_guard lock(mutex_);
    if (const auto found = entries_.find(name); found != entries_.end() && found->second == entry)
      entries_.erase(found);
    return tl::unexpected(events.error());
  }
}

std::shared_ptr<EventLog> JobLogs::find(const std::string& name) const {
  std::lock_guard lock(mutex_);
  const auto found = entries_.find(name);
  return found == entries_.end() ? nullptr : found->second->log;
}

std::shared_ptr<EventLog> JobLogs::claimed(const std::string& name, std::vector<v1::JobEvent> events) {
  if (const auto log = of(name)) {
    refresh(name, **log, events);  // the log may be older than the claim
    return *log;
  }
  const auto entry = std::make_shared<Entry>();
  entry->log->append_stored([&](std::int64_t) { return std::move(events); });
  entry->state = Entry::State::Loaded;
  std::lock_guard lock(mutex_);
  entries_[name] = entry;
  return entry->log;
}

Answer<Changed> JobLogs::change(const std::string& name,
                                const std::function<Answer<Changed>(std::int64_t last)>& change) {
  const auto log = of(name);
  if (!log) return tl::unexpected(log.error());
  Answer<Changed> changed;
  (*log)->append_stored([&](std::int64_t last) {
    changed = change(last);
    // Another thread may have changed the job in the store a moment ago, and not yet told the log.
    return changed && !changed->events.empty() ? newer(name, last, changed->events) : std::vector<v1::JobEvent>();
  });
  close_ended(name, **log);
  return changed;
}

void JobLogs::publish(const Changed& changed) {
  if (const auto log = find(changed.job.name())) refresh(changed.job.name(), *log, changed.events);
}

void JobLogs::follow(const std::string& name) {
  const auto log = find(name);
  if (log == nullptr || has_ended(log->state())) return;
  log->append_stored([&](std::int64_t last) {
    const auto job = jobs_->get(name);  // before the events: one of them may be newer than the iteration
    std::vector<v1::JobEvent> events = newer(name, last, {});
    // A server notes an iteration together with the number of the event before it. That number may be given to the
    // iteration here, unless it belongs to an event that the store has.
    const std::int64_t newest = events.empty() ? last : events.back().sequence();
    if (!job || !job->has_iteration() || job->last_sequence() <= newest) return events;
    v1::JobEvent& iteration = events.emplace_back();
    iteration.set_sequence(job->last_sequence());
    iteration.set_attempt(job->attempt());
    *iteration.mutable_time() = timestamp(std::chrono::system_clock::now());
    *iteration.mutable_iteration() = job->iteration();
    return events;
  });
  close_ended(name, *log);
}

std::vector<std::string> JobLogs::watched() const {
  std::lock_guard lock(mutex_);
  std::vector<std::string> names;
  for (const auto& [name, entry] : entries_)
    if (entry->log->is_watched()) names.push_back(name);
  return names;
}

void JobLogs::refresh(const std::string& name, EventLog& log, const std::vector<v1::JobEvent>& known) {
  log.append_stored([&](std::int64_t last) { return newer(name, last, known); });
  close_ended(name, log);
}

std::vector<v1::JobEvent> JobLogs::newer(const std::string& name, std::int64_t last, std::vector<v1::JobEvent> known) {
  auto stored = jobs_->events(name);
  std::vector<v1::JobEvent> events = stored ? std::move(*stored) : std::move(known);
  std::erase_if(events, [&](const v1::JobEvent& event) { return event.sequence() <= last; });
  return events;
}

void JobLogs::close_ended(const std::string& name, EventLog& log) {
  if (!has_ended(log.state()) || !log.close()) return;
  std::lock_guard lock(mutex_);
  ended_.push_back(name);
  if (ended_.size() <= kEndedLogs) return;
  entries_.erase(ended_.front());
  ended_.pop_front();
}

void JobLogs::forget(const std::string& name) {
  std::lock_guard lock(mutex_);
  entries_.erase(name);
  std::erase(ended_, name);
}

}  // namespace varimesh::server
