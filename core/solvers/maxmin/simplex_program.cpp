#include "core/solvers/maxmin/simplex_program.h"

#include <algorithm>

namespace varimesh::detail {
namespace {

/// Samples that lie close together have nearly the same rows, and the last digits of their weights would take ten times
/// as many steps. On the meshes of docs/repair.md that makes no more cells valid.
constexpr int kMostSteps = 2000;
/// The slopes of all entries with weight agree to within this, relative to their size.
constexpr double kAgree = 1e-6;
constexpr double kLeastSlope = 1e-3;
/// Weights below this are rounding.
constexpr double kNoWeight = 1e-15;

}  // namespace

Eigen::VectorXd simplex_weights(const Columns& K, double s, const Eigen::VectorXd& c) {
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(c.size());
  Eigen::Index first = 0;
  c.minCoeff(&first);
  weights(first) = 1;
  Eigen::VectorXd slope = s * K(first) + c;
  for (int step = 0; step < kMostSteps && slope.allFinite(); ++step) {  // they overflow in huge cells
    Eigen::Index to = 0, from = -1;
    slope.minCoeff(&to);
    for (Eigen::Index i = 0; i < weights.size(); ++i)
      if (weights(i) > 0 && (from < 0 || slope(i) > slope(from))) from = i;
    const double gap = slope(from) - slope(to);
    if (gap < kAgree * std::max(kLeastSlope, std::abs(slope(to)))) break;
    const Eigen::VectorXd &gains = K(to), &loses = K(from);
    const double bend = s * (gains(to) + loses(from) - 2 * gains(from));
    const double moved = bend * weights(from) > gap ? gap / bend : weights(from);
    weights(to) += moved;
    weights(from) -= moved;
    if (weights(from) < kNoWeight) weights(from) = 0;
    slope += moved * s * (gains - loses);
  }
  return weights;
}

}  // namespace varimesh::detail
