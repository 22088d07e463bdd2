// The quasi-Newton method: L-BFGS steps with a preconditioner and a line search.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/base/reduction.h"
#include "core/base/team.h"

namespace varimesh {

/// What the quasi-Newton method minimises. All vectors have a number per unknown. All functions are called inside
/// team.run().
class Smooth {
 public:
  virtual ~Smooth() = default;
  /// The objective where the unknowns are, +∞ if that is not allowed; then the gradient has no meaning.
  virtual double evaluate(std::span<double> gradient) = 0;
  /// z = M⁻¹ r, with M near the second derivative of the objective.
  virtual void precondition(std::span<const double> r, std::span<double> z) = 0;
  /// Remembers where the unknowns are.
  virtual void mark() = 0;
  /// Puts the unknowns to where mark() found them plus `alpha` times `step`.
  virtual void move(double alpha, std::span<const double> step) = 0;
  /// The largest displacement of a node in a step, relative to the size of the cells around it.
  virtual double largest(std::span<const double> step) const = 0;
};

/// When the quasi-Newton method ends.
struct QuasiNewtonRules {
  int most_steps = 0;
  int most_trials = 0;  ///< Of a line search.
  double little = 0;    ///< It ends when a whole step would lower the objective by about this share of it.
  double noise = 0;     ///< A change of the objective by no more than this share of it is rounding.
};

/// What it did.
struct QuasiNewtonOutcome {
  int steps = 0;
  double residual = 0;        ///< Smooth::largest() of the last step that was taken.
  double first_gradient = 0;  ///< √(g · g) at the start, 0 if the objective is infinite there,
  double last_gradient = 0;   ///< and at the end.
};

/// J. Nocedal, S. J. Wright, Numerical Optimization, 2nd edition, 2006, algorithm 7.4, with M⁻¹ in place of a multiple
/// of the unit matrix. It keeps its memory from one minimisation to the next, but nothing else.
class QuasiNewton {
 public:
  QuasiNewton(std::size_t unknowns, const Team& team)
      : team_(team), reduction_(team), gradient_(unknowns), next_(unknowns), step_(unknowns), work_(unknowns) {}

  QuasiNewtonOutcome minimise(Smooth& objective, const QuasiNewtonRules& rules);

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
  void forget() {
    used_ = 0;
    scale_ = 1;
  }
  /// Notes step_ and the change of the gradient along it, in work_. Ignores it if the curvature there is not positive.
  /// The first one decides by what M⁻¹ is scaled.
  void note(Smooth& objective);
  /// step_ ← −H g with the present approximation H of the inverse of the second derivative. Returns g · step.
  double direction(Smooth& objective);
  double dot(std::span<const double> a, std::span<const double> b);
  void add(double factor, std::span<const double> from, std::span<double> to);

  const Team& team_;
  Reduction reduction_;
  std::vector<Pair> pairs_;
  std::size_t newest_ = 0, used_ = 0;
  double scale_ = 1;  ///< Of M⁻¹.
  std::vector<double> gradient_, next_, step_, work_, scaled_;
};

}  // namespace varimesh
