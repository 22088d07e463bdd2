// Whether a forecast may be believed, judged from what it has said before.
#pragma once

#include <deque>

namespace varimesh {

/// Remembers what was said about the end of a run. Nobody knows whether the last forecast is right, but it shows how
/// good those before were: if they were wrong, the last one deserves no more trust.
class PastForecasts {
 public:
  /// A forecast within this factor of what was left is right, and so is one that is wrong by less than half a second.
  static constexpr double kFactor = 2, kSeconds = 0.5;

  /// Notes a forecast.
  /// @param now   seconds since the beginning of the run
  /// @param left  seconds that seem to be left then
  void add(double now, double left);

  /// Whether what was said in the last half of the run so far was right for nearly all of that time, if the run ends as
  /// the last forecast says. True if there was no other.
  bool agree() const;

 private:
  struct Said {
    double at, left;
  };
  std::deque<Said> said_;
};

}  // namespace varimesh
