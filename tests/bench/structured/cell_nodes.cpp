#include "tests/bench/structured/cell_nodes.h"

#include <algorithm>

#include "core/reference/nodes.h"

namespace varimesh::bench {
namespace {

/// The weights of the corners at a lattice point of a straight-sided cell.
std::array<double, 8> weights_at(Shape shape, const Steps& local, int order) {
  std::array<double, 8> weights{};
  if (shape == Shape::Hexahedron) {
    for (unsigned corner = 0; corner < 8; ++corner) {
      weights[corner] = 1;
      for (unsigned k = 0; k < 3; ++k)
        weights[corner] *= static_cast<double>((corner >> k & 1) != 0 ? local[k] : order - local[k]) / order;
    }
    return weights;
  }
  // The point lies in the tetrahedron whose vertices step along the axes in the order of falling coordinates.
  Steps axes{0, 1, 2};
  std::stable_sort(axes.begin(), axes.end(),
                   [&](int a, int b) { return local[std::size_t(a)] > local[std::size_t(b)]; });
  std::size_t corner = 0;
  int last = order;
  for (const int axis : axes) {
    weights[corner] = static_cast<double>(last - local[std::size_t(axis)]) / order;
    last = local[std::size_t(axis)];
    corner |= std::size_t{1} << axis;
  }
  weights[corner] = static_cast<double>(last) / order;
  return weights;
}

Point weighted(const Corners& corners, const std::array<double, 8>& weights, std::size_t count) {
  Point sum{};
  for (std::size_t corner = 0; corner < count; ++corner)
    for (std::size_t k = 0; k < 3; ++k) sum[k] += weights[corner] * corners.at[corner][k];
  return sum;
}

}  // namespace

Point node_in_cell(Shape shape, const Corners& corners, const Steps& local, int order) {
  const std::array<double, 8> weights = weights_at(shape, local, order);
  Point point = weighted(corners, weights, 8);
  const double share = weights[0] + weights[1] + weights[2] + weights[3];
  if (!corners.on_sphere || share == 0) return point;
  Point chord = weighted(corners, weights, 4);
  for (double& x : chord) x /= share;
  const double outwards = kRadius / length(chord) - 1;
  if (share == 1) {
    for (double& x : point) x *= kRadius / length(chord);
    return point;
  }
  const double blend = shape == Shape::Hexahedron ? share : share * share;
  for (std::size_t k = 0; k < 3; ++k) point[k] += blend * outwards * chord[k];
  return point;
}

std::vector<Steps> simplex_nodes(Shape shape, const Steps& axes, bool mirrored, int order) {
  const auto dimension = std::size_t(reference::info(shape).dimension);
  std::vector<Steps> nodes;
  for (const auto& at : reference::lattice(shape, order)) {
    Steps weights{at[0], at[1], at[2]};  // of the second, third and fourth vertex
    if (mirrored) std::swap(weights[dimension - 2], weights[dimension - 1]);
    Steps node{};
    // The vertex behind step s has taken the steps up to s.
    for (std::size_t s = 0; s < dimension; ++s)
      for (std::size_t later = s; later < dimension; ++later) node[std::size_t(axes[s])] += weights[later];
    nodes.push_back(node);
  }
  return nodes;
}

std::vector<Steps> tensor_nodes(Shape shape, bool mirrored, int order) {
  std::vector<Steps> nodes;
  for (const auto& at : reference::lattice(shape, order))
    nodes.push_back(mirrored ? Steps{at[1], at[0], at[2]} : Steps{at[0], at[1], at[2]});
  return nodes;
}

}  // namespace varimesh::bench
