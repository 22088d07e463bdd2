#include "core/solvers/maxmin/simplex_program.h"

#include <algorithm>
#include <vector>

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

/// VectorXd::allFinite() and minCoeff() with an index look at one entry after the other; these take several at a time.
bool is_finite(const Eigen::VectorXd& x) { return (x - x).sum() == 0; }

Eigen::Index first_smallest(const Eigen::VectorXd& x) {
  return std::find(x.data(), x.data() + x.size(), x.minCoeff()) - x.data();
}

}  // namespace

Eigen::VectorXd simplex_weights(const Columns& K, double s, const Eigen::VectorXd& c) {
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(c.size());
  Eigen::Index first = 0;
  c.minCoeff(&first);
  weights(first) = 1;
  std::vector<Eigen::Index> with_weight{first};  // ascending; few of the many entries
  Eigen::VectorXd slope = s * K(first) + c;
  for (int step = 0; step < kMostSteps && is_finite(slope); ++step) {  // they overflow in huge cells
    const Eigen::Index to = first_smallest(slope);
    const Eigen::Index from = *std::ranges::max_element(with_weight, {}, [&](Eigen::Index i) { return slope(i); });
    const double gap = slope(from) - slope(to);
    if (gap < kAgree * std::max(kLeastSlope, std::abs(slope(to)))) break;
    const Eigen::VectorXd &gains = K(to), &loses = K(from);
    const double bend = s * (gains(to) + loses(from) - 2 * gains(from));
    const double moved = bend * weights(from) > gap ? gap / bend : weights(from);
    if (weights(to) == 0) with_weight.insert(std::ranges::lower_bound(with_weight, to), to);
    weights(to) += moved;
    weights(from) -= moved;
    if (weights(from) < kNoWeight) weights(from) = 0;
    std::erase_if(with_weight, [&](Eigen::Index i) { return !(weights(i) > 0); });
    slope += moved * s * (gains - loses);
  }
  return weights;
}

}  // namespace varimesh::detail
