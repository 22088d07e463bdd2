#include "core/layers/spacing.h"

#include <algorithm>
#include <cmath>

#include "core/base/index.h"

namespace varimesh::detail {
namespace {

using Vector = Eigen::Vector3d;

/// The height, relative to the wall's edges, at which the grading has half of its weight. In higher cells waves lose
/// accuracy by it, at order 2 sooner than at higher orders (docs/accuracy.md).
double fades_at(int order) { return order == 2 ? 0.9 : order == 3 ? 1.2 : 1.3; }
/// The share of the growth that the nodes follow. If they follow all of it, solutions that decay faster than an
/// exponential lose more, and exponentials gain hardly more.
constexpr double kShareOfGrowth = 0.6;
/// A cell does not grow by more from one end to the other, whatever its neighbours are.
constexpr double kMostGrowth = 4;

/// The share of a cell's height below the share ξ of its nodes.
double graded(double xi, double growth) {
  const double rate = kShareOfGrowth * std::log(std::clamp(growth, 1 / kMostGrowth, kMostGrowth));
  return std::abs(rate) < 1e-6 ? xi : std::expm1(rate * xi) / std::expm1(rate);
}

/// The curve through the equispaced nodes of an edge.
Vector on_edge(const Vector* nodes, int order, double xi) {
  Vector sum = Vector::Zero();
  for (int i = 0; i <= order; ++i) {
    double value = 1;
    for (int j = 0; j <= order; ++j)
      if (j != i) value *= (order * xi - j) / (i - j);
    sum += value * nodes[i];
  }
  return sum;
}

/// The point of an edge that is this share of the way along its chord.
Vector at_share(const Vector* nodes, int order, double share) {
  const Vector chord = nodes[order] - nodes[0];
  double low = 0, high = 1;
  for (int halving = 0; halving < 60; ++halving) {
    const double middle = (low + high) / 2;
    const bool is_below = (on_edge(nodes, order, middle) - nodes[0]).dot(chord) < share * chord.squaredNorm();
    (is_below ? low : high) = middle;
  }
  return on_edge(nodes, order, (low + high) / 2);
}

}  // namespace

double growth_across(const std::vector<double>& heights, std::size_t cell) {
  const bool has_below = cell > 0, has_above = cell + 1 < heights.size();
  if (has_below && has_above) return std::sqrt(heights[cell + 1] / heights[cell - 1]);
  if (has_above) return heights[cell + 1] / heights[cell];
  return has_below ? heights[cell] / heights[cell - 1] : 1;
}

double graded_share(double xi, double growth, double height, double size, int order) {
  const double weight = 1 / (1 + std::pow(height / (fades_at(order) * size), 4));
  return (1 - weight) * xi + weight * graded(xi, growth);
}

std::vector<Vector> spaced_column(const std::vector<Vector>& points, int cells, int order, double size,
                                  LayerSpacing spacing) {
  if (spacing == LayerSpacing::Keep) return points;
  std::vector<double> heights;
  for (int cell = 0; cell < cells; ++cell)
    heights.push_back((points[at((cell + 1) * order)] - points[at(cell * order)]).norm());
  std::vector<Vector> spaced = points;
  for (int cell = 0; cell < cells; ++cell) {
    const double ratio = growth_across(heights, at(cell));
    for (int node = 1; node < order; ++node) {
      const double xi = static_cast<double>(node) / order;
      const double share =
          spacing == LayerSpacing::Graded ? graded_share(xi, ratio, heights[at(cell)], size, order) : xi;
      spaced[at(cell * order + node)] = at_share(&points[at(cell * order)], order, share);
    }
  }
  return spaced;
}

}  // namespace varimesh::detail
