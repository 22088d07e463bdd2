// Which phase comes next, and when to stop.
#pragma once

#include <cstdint>
#include <optional>

#include "core/optimise/optimiser.h"

namespace varimesh {

/// Which phase comes next. Method::Auto sweeps until every cell that can be is certified valid, or until so many sweeps
/// brought no more of them, and goes on with Newton; where a Newton step finds no lower energy, a few sweeps get it off
/// the spot.
class PhaseChooser {
 public:
  PhaseChooser(Method method, std::int64_t repairable) : method_(method), fewest_(repairable) {
    newton_ = method == Method::Newton || (method == Method::Auto && repairable == 0);
  }

  Phase phase() const { return newton_ ? Phase::Newton : Phase::Sweeps; }

  /// After an iteration: false where nothing is left to try.
  bool next(std::int64_t repairable, bool stuck);

 private:
  Method method_;
  std::int64_t fewest_;
  bool newton_ = false;
  int patience_ = 10;  ///< Sweeps without fewer uncertified cells.
  int times_stuck_ = 0;
};

/// Whether an iteration was the last.
class Stopper {
 public:
  explicit Stopper(const Options& options) : options_(options) {}

  /// Asked after every iteration, before it starts with iteration 0 as things are. `bound`: the proved minimum of the
  /// scaled Jacobian, asked for with until_js alone.
  std::optional<StopReason> after(const Iteration& iteration, bool converged, double bound);

 private:
  const Options& options_;
  std::int64_t fewest_ = -1;
  int without_fewer_ = 0;
};

}  // namespace varimesh
