// How long a job may still take.
#pragma once

#include <deque>
#include <optional>

#include "varimesh/v1/optimise.pb.h"

namespace varimesh::client {

/// Takes iterations as they come. It supposes that the residual goes on falling as it did lately, and that no limit of
/// the options is passed over; a job may stop sooner for other reasons. With the objective `worst`, whose stages nobody
/// can count beforehand, the limit of time alone tells.
class Estimate {
 public:
  explicit Estimate(const v1::Options& options);

  void add(const v1::Iteration& iteration);
  /// Nothing where too little is known, or nothing tells.
  std::optional<double> seconds_left() const;

 private:
  struct Point {
    double seconds, residual;  ///< The residual as its decimal logarithm.
  };
  const double tolerance_;
  const int max_iterations_;
  const double time_limit_;  ///< 0: none.
  const bool has_stages_;
  std::deque<Point> recent_;
  v1::Iteration latest_;
};

}  // namespace varimesh::client
