// An estimate of how long a job will still take.
#pragma once

#include <deque>
#include <optional>

#include "varimesh/v1/optimise.pb.h"

namespace varimesh::client {

/// Estimates the remaining time from the iterations so far. It assumes that the residual goes on falling at its recent
/// rate, and that the job stops at the first of the limits in its options; a job may stop earlier for other reasons.
/// With the objectives `worst` and `accuracy`, which is the default, the number of stages or rounds is not known in
/// advance, so only the time limit counts. An estimate that is higher than an earlier one shows that the residual does
/// not fall as assumed, so it is no forecast.
class RemainingTime {
 public:
  explicit RemainingTime(const v1::Options& options);

  /// Takes the next iteration.
  void add(const v1::Iteration& iteration);
  /// The forecast, which never rises. Nothing if there is none: without a time limit, if the objective is `worst` or
  /// `accuracy`, or if the current phase has had fewer than three iterations.
  std::optional<double> seconds() const { return forecast_; }

 private:
  std::optional<double> estimate() const;

  struct Point {
    double seconds, log_residual;  ///< The decimal logarithm of the residual.
  };
  const double tolerance_;
  const int max_iterations_;  ///< 0: the default, which says nothing about the time.
  const double time_limit_;   ///< 0: none.
  const bool has_stages_;
  std::deque<Point> recent_;  ///< The last iterations of the current phase.
  v1::Iteration latest_;
  std::optional<double> forecast_;
  std::optional<double> least_;  ///< The last forecast.
};

}  // namespace varimesh::client
