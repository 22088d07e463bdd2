// The room that a curved face leaves, by duality.
#include <algorithm>
#include <cmath>

#include "core/diagnosis/fixed_samples.h"

namespace varimesh::detail {
namespace {

constexpr int kMostSteps = 20000;
constexpr double kGap = 1e-3;      // between the bounds of a small room
constexpr double kNothing = 1e-9;  // a smaller distance is rounding

double binomial(int n, int k) {
  double result = 1;
  for (int i = 1; i <= k; ++i) result *= static_cast<double>(n - k + i) / i;
  return result;
}

}  // namespace

Eigen::MatrixXd bernstein_on_triangle(int degree, const Eigen::MatrixXd& points) {
  Eigen::MatrixXd values(points.rows(), (degree + 1) * (degree + 2) / 2);
  for (Eigen::Index p = 0; p < points.rows(); ++p) {
    // The reference triangle has the vertices (−1, −1), (1, −1) and (−1, 1).
    const double a = (points(p, 0) + 1) / 2, b = (points(p, 1) + 1) / 2, c = 1 - a - b;
    Eigen::Index column = 0;
    for (int i = 0; i <= degree; ++i)
      for (int j = 0; i + j <= degree; ++j)
        values(p, column++) = binomial(degree, i) * binomial(degree - i, j) * std::pow(a, i) * std::pow(b, j) *
                              std::pow(c, degree - i - j);
  }
  return values;
}

double face_room(const Eigen::MatrixXd& fields, const Eigen::MatrixXd& normals, double enough) {
  const Eigen::Index points = fields.rows(), count = fields.cols();
  Eigen::MatrixXd corner(3 * count, points);
  for (Eigen::Index p = 0; p < points; ++p)
    for (int c = 0; c < 3; ++c)
      corner.col(p).segment(c * count, count) =
          std::sqrt(static_cast<double>(count)) * normals(p, c) * fields.row(p).transpose();
  Eigen::VectorXd weight = Eigen::VectorXd::Zero(points), nearest = corner.col(0);
  weight[0] = 1;
  for (int step = 0; step < kMostSteps; ++step) {
    const double distance = nearest.norm();
    if (distance <= kNothing) return 0;
    const Eigen::VectorXd along = corner.transpose() * nearest;
    Eigen::Index least = 0, most = 0;
    along.minCoeff(&least);
    (weight.array() > 0).select(along.array(), along.minCoeff() - 1).maxCoeff(&most);
    const double bound = std::max(0.0, along[least] / distance);
    if (bound > enough) return bound;
    if (distance <= enough && distance - bound <= kGap) return distance;
    const Eigen::VectorXd move = corner.col(least) - corner.col(most);
    const double square = move.squaredNorm();
    if (!(square > 0) || !(along[most] > along[least])) return distance;
    const double share = std::min(weight[most], (along[most] - along[least]) / square);
    weight[most] = share == weight[most] ? 0 : weight[most] - share;
    weight[least] += share;
    nearest += share * move;
  }
  return nearest.norm();
}

}  // namespace varimesh::detail
