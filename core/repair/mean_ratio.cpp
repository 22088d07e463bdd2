#include "core/repair/mean_ratio.h"

#include <Eigen/LU>
#include <cmath>

namespace varimesh {

double mean_ratio(const Eigen::Ref<const Eigen::Matrix<double, Eigen::Dynamic, 3>>& vertices) {
  double squares = 0;
  for (Eigen::Index i = 0; i < vertices.rows(); ++i)
    for (Eigen::Index j = 0; j < i; ++j) squares += (vertices.row(i) - vertices.row(j)).squaredNorm();
  if (!(squares > 0)) return 0;
  if (vertices.rows() == 3) {
    const Eigen::RowVector3d a = vertices.row(1) - vertices.row(0), b = vertices.row(2) - vertices.row(0);
    return 2 * std::sqrt(3.0) * (a[0] * b[1] - a[1] * b[0]) / squares;
  }
  Eigen::Matrix3d edges;
  for (int i = 0; i < 3; ++i) edges.row(i) = vertices.row(i + 1) - vertices.row(0);
  const double volume = edges.determinant() / 6;
  return std::copysign(12 * std::pow(3 * std::abs(volume), 2.0 / 3) / squares, volume);
}

}  // namespace varimesh
