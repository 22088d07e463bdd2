// An estimate of how long a job will still take.
#pragma once

#include <deque>
#include <optional>

#include "varimesh/v1/optimise.pb.h"

namespace varimesh::client {

/// Estimates the remaining time from the iterations so far. It assumes that the residual goes on falling at its recent
/// rate, and that the job stops at the first of the limits in its options; a job may stop earlier for other reasons.
/// With the objective `worst`, the number of stages is not known beforehand, so only the time limit counts.
class RemainingTime {
 public:
  explicit RemainingTime(const v1::Options& options);

  /// Takes the next iteration.
  void add(const v1::Iteration& iteration);
  /// The estimate. Nothing if there is no time limit, and the objective is `worst` or the current phase has had fewer
  /// than three iterations.
  std::optional<double> seconds() const;

 private:
  struct Point {
    double seconds, log_residual;  ///< The decimal logarithm of the residual.
  };
  const double tolerance_;
  const int max_iterations_;
  const double time_limit_;  ///< 0: none.
  const bool has_stages_;
  std::deque<Point> recent_;  ///< The last iterations of the current phase.
  v1::Iteration latest_;
};

}  // namespace varimesh::client
