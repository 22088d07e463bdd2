// How long a job will still take, as it says itself, and how much of its time has passed.
#pragma once

#include <chrono>
#include <optional>

#include "varimesh/v1/job.pb.h"

namespace varimesh::client {

/// Counts down what the messages of a job say (Iteration.seconds_left). It shows nothing where they say nothing: a job
/// whose end nobody can tell, and one on an older server.
class TimeLeft {
 public:
  using Clock = std::chrono::steady_clock;

  /// Takes a message that came at this time.
  void note(const v1::Iteration& iteration, Clock::time_point now);
  void note(const v1::Work& work, Clock::time_point now);

  /// The seconds left at this time; nothing if the last message did not say, or if the job lasts longer than it said.
  std::optional<double> seconds(Clock::time_point now) const;

  /// The share of the job's time that has passed, from 0 to 1. It never falls, also where the seconds left rise. While
  /// nobody can tell when the job will end, it grows ever slower. Nothing if no message has ever said that.
  std::optional<double> share(Clock::time_point now);

 private:
  std::optional<Clock::time_point> end_;
  Clock::time_point began_{};  ///< When the run began, from the seconds of the last iteration.
  std::optional<double> share_;
  struct Known {
    double passed = 0, share = 0;
  } known_;  ///< What share() said while the end was known, and the seconds that had passed.
};

}  // namespace varimesh::client
