// A convex quadratic program on the unit simplex.
#pragma once

#include <Eigen/Core>
#include <functional>

namespace varimesh::detail {

/// Returns a column of a matrix. The reference stays valid.
using Columns = std::function<const Eigen::VectorXd&(Eigen::Index)>;

/// The weights w ≥ 0 with sum 1 that minimise s wᵀ K w / 2 + cᵀ w, to within rounding or kMostSteps steps. K is
/// symmetric and positive semidefinite, and s > 0. It asks only for the columns of the entries that have had weight.
/// Each step moves weight from one entry to another, those with the greatest and the least slope (J. Platt, Fast
/// training of support vector machines using sequential minimal optimization, 1999). Ties go to the entry with the
/// smallest number, so the result is the same on every machine with the same arithmetic.
Eigen::VectorXd simplex_weights(const Columns& K, double s, const Eigen::VectorXd& c);

}  // namespace varimesh::detail
