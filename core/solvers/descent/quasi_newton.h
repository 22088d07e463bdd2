// The method of L-BFGS: the step of a quasi-Newton method from the last few steps and changes of the gradient.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/preconditioner/reduction.h"

namespace varimesh {

/// J. Nocedal, S. J. Wright, Numerical Optimization, 2nd edition, 2006, algorithm 7.4, with M⁻¹ in place of a multiple
/// of the unit matrix.
class QuasiNewton {
 public:
  QuasiNewton(std::size_t unknowns, const Team& team) : unknowns_(unknowns), team_(team), reduction_(team) {}

  void forget() {
    used_ = 0;
    scale_ = 1;
  }

  /// Notes a step and the change of the gradient along it. Ignores it if the curvature there is not positive. The first
  /// one decides by what M⁻¹ is scaled.
  template <class Precondition>
  void note(std::span<const double> step, std::span<const double> change, const Precondition& precondition) {
    if (!add_pair(step, change) || used_ > 1) return;
    scaled_.resize(unknowns_);
    precondition(change, std::span<double>(scaled_));
    scale_ = pair(0).curvature / dot(change, scaled_);
  }

  /// step ← −H g with the present approximation H of the inverse of the second derivative. precondition(r, z) sets z =
  /// M⁻¹ r. Returns g · step. `step` and `work` have as many numbers as the gradient.
  template <class Precondition>
  double direction(std::span<const double> g, std::span<double> step, std::span<double> work,
                   const Precondition& precondition) {
    begin(g, work);
    precondition(std::span<const double>(work), step);
    return end(g, step);
  }

  double dot(std::span<const double> a, std::span<const double> b);

  /// Pairs of a step and a change that are kept.
  static constexpr std::size_t kPairs = 8;

 private:
  struct Pair {
    std::vector<double> step, change;
    double curvature = 0;  ///< step · change
    double alpha = 0;
  };
  /// The pair that is `age` older than the last one.
  Pair& pair(std::size_t age) { return pairs_[(newest_ + kPairs - age) % kPairs]; }
  bool add_pair(std::span<const double> step, std::span<const double> change);
  void add(double factor, std::span<const double> from, std::span<double> to);
  void begin(std::span<const double> g, std::span<double> q);
  double end(std::span<const double> g, std::span<double> step);

  std::size_t unknowns_;
  const Team& team_;
  Reduction reduction_;
  std::vector<Pair> pairs_;
  std::size_t newest_ = 0, used_ = 0;
  double scale_ = 1;  ///< Of M⁻¹.
  std::vector<double> scaled_;
};

}  // namespace varimesh
