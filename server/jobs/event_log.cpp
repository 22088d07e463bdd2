// Stores, thins and delivers events.
#include "server/jobs/event_log.h"

#include <algorithm>
#include <cassert>
#include <utility>

#include "server/jobs/timestamps.h"

namespace varimesh::server {
namespace {

/// Returns the first event whose number is greater than `after`. The events must be ordered by number.
template <class Events>
auto first_after(const Events& events, std::int64_t after) {
  return std::upper_bound(events.begin(), events.end(), after,
                          [](std::int64_t sequence, const v1::JobEvent& event) { return sequence < event.sequence(); });
}

}  // namespace

std::int64_t EventLog::append(v1::JobEvent event) {
  std::int64_t sequence = 0;
  {
    std::lock_guard numbers(numbers_);
    std::lock_guard lock(mutex_);
    sequence = ++last_sequence_;
    event.set_sequence(sequence);
    work_.reset();
    keep(std::move(event));
  }
  notify();
  return sequence;
}

void EventLog::keep(v1::JobEvent event) {
  if (!event.has_iteration()) return kept_.push_back(std::move(event));
  iterations_.push_back(std::move(event));
  if (iterations_.size() <= limits_.max_iterations) return;
  dropped_through_ = iterations_.front().sequence();
  iterations_.pop_front();
}

void EventLog::append_stored(const std::function<std::vector<v1::JobEvent>(std::int64_t last_sequence)>& store) {
  {
    std::lock_guard numbers(numbers_);
    add(store(last_sequence()));
  }
  notify();
}

void EventLog::add(std::vector<v1::JobEvent> events) {
  std::lock_guard lock(mutex_);
  work_.reset();
  for (v1::JobEvent& event : events) {
    assert(event.sequence() > last_sequence_);
    last_sequence_ = event.sequence();
    keep(std::move(event));
  }
}

void EventLog::set_work(v1::Work work) {
  {
    std::lock_guard lock(mutex_);
    work_ = std::move(work);
    ++works_;
  }
  notify();
}

std::optional<v1::Work> EventLog::work_after(std::int64_t& seen) const {
  std::lock_guard lock(mutex_);
  if (!work_ || works_ <= seen) return std::nullopt;
  seen = works_;
  return work_;
}

std::shared_ptr<const std::string> EventLog::watch_mesh() {
  std::lock_guard lock(mutex_);
  mesh_watched_ = std::chrono::steady_clock::now();
  return mesh_;
}

bool EventLog::is_mesh_watched() const {
  constexpr std::chrono::seconds kLast{10};
  std::lock_guard lock(mutex_);
  return mesh_watched_ && !closed_ && std::chrono::steady_clock::now() - *mesh_watched_ < kLast;
}

void EventLog::show_mesh(std::shared_ptr<const std::string> bytes) {
  std::lock_guard lock(mutex_);
  if (!closed_) mesh_ = std::move(bytes);
}

bool EventLog::close() {
  {
    std::lock_guard lock(mutex_);
    if (closed_) return false;
    closed_ = true;
    mesh_.reset();
  }
  notify();
  return true;
}

v1::JobState EventLog::state() const {
  std::lock_guard lock(mutex_);
  const auto newest =
      std::find_if(kept_.rbegin(), kept_.rend(), [](const v1::JobEvent& event) { return event.has_state_change(); });
  return newest == kept_.rend() ? v1::JOB_STATE_UNSPECIFIED : newest->state_change().state();
}

EventLog::Next EventLog::next(std::int64_t after, std::chrono::nanoseconds min_interval,
                              std::chrono::system_clock::time_point last_iteration, v1::JobEvent* event) const {
  std::lock_guard lock(mutex_);
  const auto kept = first_after(kept_, after);
  auto iteration = first_after(iterations_, after);
  const auto last = kept == kept_.end() ? iterations_.end() : first_after(iterations_, kept->sequence());
  if (static_cast<std::size_t>(last - iteration) > limits_.max_backlog)
    iteration = last - static_cast<std::ptrdiff_t>(limits_.max_backlog / 4);
  if (min_interval.count() > 0)
    iteration = std::find_if(iteration, last, [&](const v1::JobEvent& candidate) {
      const auto time = time_point(candidate.time());
      // An earlier time: the clock was set back.
      return time >= last_iteration + min_interval || time < last_iteration;
    });

  if (iteration != last)
    *event = *iteration;
  else if (kept != kept_.end())
    *event = *kept;
  else
    return closed_ ? Next::End : Next::Wait;
  // All events in between are iterations, since events of the other kinds are never skipped. The numbers that an
  // earlier range left unused are not counted.
  const std::int64_t range = (event->sequence() - 1) / kSequenceRange * kSequenceRange;
  event->set_thinned(event->sequence() - std::max(after, range) - 1);
  return Next::Event;
}

bool EventLog::can_resume_after(std::int64_t sequence) const {
  std::lock_guard lock(mutex_);
  return sequence == 0 || (sequence >= dropped_through_ && sequence <= last_sequence_);
}

std::int64_t EventLog::last_sequence() const {
  std::lock_guard lock(mutex_);
  return last_sequence_;
}

std::int64_t EventLog::oldest_sequence() const {
  std::lock_guard lock(mutex_);
  return dropped_through_ + 1;
}

bool EventLog::is_watched() const {
  std::lock_guard lock(mutex_);
  return !closed_ &&
         std::any_of(listeners_.begin(), listeners_.end(), [](const auto& listener) { return !listener.expired(); });
}

void EventLog::subscribe(std::weak_ptr<Listener> listener) {
  std::lock_guard lock(mutex_);
  std::erase_if(listeners_, [](const auto& old) { return old.expired(); });
  listeners_.push_back(std::move(listener));
}

void EventLog::notify() {
  std::vector<std::weak_ptr<Listener>> listeners;
  {
    std::lock_guard lock(mutex_);
    listeners = listeners_;
  }
  for (const auto& weak : listeners)
    if (const auto listener = weak.lock()) listener->poke();
}

}  // namespace varimesh::server
