#include "client/io/time_left.h"

#include <algorithm>

namespace varimesh::client {
namespace {

TimeLeft::Clock::duration ticks(double seconds) {
  constexpr double kAge = 1e9;  // some thirty years: more than anybody waits, and less than the clock can count
  return std::chrono::duration_cast<TimeLeft::Clock::duration>(
      std::chrono::duration<double>(std::clamp(seconds, 0.0, kAge)));
}

template <class Message>
std::optional<TimeLeft::Clock::time_point> end_of(const Message& message, TimeLeft::Clock::time_point now) {
  return message.has_seconds_left() ? std::optional(now + ticks(message.seconds_left())) : std::nullopt;
}

double seconds_between(TimeLeft::Clock::time_point from, TimeLeft::Clock::time_point to) {
  return std::chrono::duration<double>(to - from).count();
}

}  // namespace

void TimeLeft::note(const v1::Iteration& iteration, Clock::time_point now) {
  began_ = now - ticks(iteration.seconds());
  end_ = end_of(iteration, now);
}

void TimeLeft::note(const v1::Work& work, Clock::time_point now) {
  if (began_ == Clock::time_point()) began_ = now;
  end_ = end_of(work, now);
}

std::optional<double> TimeLeft::seconds(Clock::time_point now) const {
  constexpr double kLate = 0.5;
  if (!end_ || seconds_between(*end_, now) > kLate) return std::nullopt;
  return std::max(0.0, seconds_between(now, *end_));
}

std::optional<double> TimeLeft::share(Clock::time_point now) {
  const double passed = seconds_between(began_, now);
  if (end_) {
    const double whole = std::max(passed, seconds_between(began_, *end_));
    share_ = std::max(share_.value_or(0), whole > 0 ? passed / whole : 0);
    known_ = {passed, *share_};
  } else if (share_ && passed > known_.passed) {
    share_ = std::max(*share_, known_.share + (1 - known_.share) * (1 - known_.passed / passed));
  }
  return share_;
}

}  // namespace varimesh::client
