#include "core/hessian/folded_gradient.h"

#include <Eigen/Dense>
#include <algorithm>
#include <bit>
#include <cmath>

#include "core/reference/mirrors.h"
#include "core/reference/nodes.h"
#include "core/reference/quadrature.h"

namespace varimesh {
namespace {

using Permutation = std::vector<int>;
using Orbit = FoldedGradient::Orbit;

/// Where a mirror takes each of these points; empty where one has no image among them.
Permutation images(const reference::Mirrors& mirrors, int axis, const reference::Points& points) {
  // s of ξ = origin + directionsᵀ s, and the mirror in reference coordinates.
  const Eigen::MatrixXd to_s = mirrors.directions.transpose().inverse();
  Permutation out;
  for (Eigen::Index p = 0; p < points.rows(); ++p) {
    const double s = to_s.row(axis).dot(points.row(p).transpose() - mirrors.origin);
    const Eigen::RowVectorXd image = points.row(p) - 2 * s * mirrors.directions.row(axis);
    Eigen::Index nearest = 0;
    if (!((points.rowwise() - image).rowwise().norm().minCoeff(&nearest) < 1e-10)) return {};
    out.push_back(static_cast<int>(nearest));
  }
  return out;
}

/// The set of mirrors that the low bits of `number` choose among those in `of`.
int chosen(int of, int number) {
  int set = 0;
  for (int bit = 0; of >> bit != 0; ++bit)
    if ((of >> bit & 1) != 0) {
      set |= (number & 1) << bit;
      number >>= 1;
    }
  return set;
}

double sign(int parity, int image) { return std::popcount(static_cast<unsigned>(parity & image)) % 2 == 0 ? 1 : -1; }

/// What `mirrors` make of each item: orbits by size, and the mirrors that move their members.
struct Orbits {
  std::vector<Orbit> orbits;
  std::vector<int> moved_by;
};

Orbits orbits_of(const std::vector<Permutation>& mirrors, int items) {
  std::vector<std::pair<int, Orbit>> found;
  std::vector<bool> seen(items, false);
  for (int item = 0; item < items; ++item) {
    if (seen[item]) continue;
    int moved = 0;
    for (std::size_t m = 0; m < mirrors.size(); ++m) moved |= (mirrors[m][item] != item ? 1 : 0) << m;
    Orbit orbit;
    orbit.mirrors = std::popcount(static_cast<unsigned>(moved));
    for (int g = 0; g < 1 << orbit.mirrors; ++g) {
      int image = item;
      for (std::size_t m = 0; m < mirrors.size(); ++m)
        if ((chosen(moved, g) >> m & 1) != 0) image = mirrors[m][image];
      orbit.member[g] = image;
      seen[image] = true;
    }
    found.emplace_back(moved, orbit);
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const auto& a, const auto& b) { return a.second.mirrors < b.second.mirrors; });
  Orbits out;
  for (const auto& [moved, orbit] : found) {
    out.moved_by.push_back(moved);
    out.orbits.push_back(orbit);
  }
  return out;
}

/// Component `number` of what the derivative `slopes` (points × nodes) makes of a node component of that orbit.
double entry(const Eigen::MatrixXd& slopes, const Orbit& point, int point_number, const Orbit& node, int node_number) {
  double sum = 0;
  for (int h = 0; h < 1 << point.mirrors; ++h)
    for (int g = 0; g < 1 << node.mirrors; ++g)
      sum += sign(point_number, h) * sign(node_number, g) * slopes(point.member[h], node.member[g]);
  return std::ldexp(sum, -point.mirrors - node.mirrors);
}

}  // namespace

FoldedGradient fold_gradient(const CellSet& cells) {
  const int d = cells.dimension;
  const reference::Mirrors mirrors = reference::mirrors(cells.shape);
  const reference::Points& nodes = reference::nodes(cells.shape, cells.order, reference::NodeSet::Optimised, d);
  const reference::Points points = reference::quadrature(cells.shape, cells.order, cells.degree).points;
  std::vector<Permutation> of_nodes, of_points;
  std::array<int, 3> turned{};  // the mirrors that turn direction α round
  for (int axis = 0; axis < mirrors.count; ++axis) {
    Permutation node_images = images(mirrors, axis, nodes), point_images = images(mirrors, axis, points);
    if (node_images.empty() || point_images.empty()) continue;
    turned[axis] = 1 << of_nodes.size();
    of_nodes.push_back(std::move(node_images));
    of_points.push_back(std::move(point_images));
  }

  std::array<Eigen::MatrixXd, 3> slopes;  // ∂φ_n/∂s_α, points × nodes
  for (int alpha = 0; alpha < d; ++alpha) {
    slopes[alpha].setZero(cells.points, cells.nodes_per_cell);
    for (int n = 0; n < cells.nodes_per_cell; ++n)
      for (int k = 0; k < d; ++k)
        slopes[alpha].col(n) +=
            mirrors.directions(alpha, k) *
            Eigen::Map<const Eigen::VectorXd>(cells.derivatives_of(n) + k * cells.stride, cells.points);
  }

  FoldedGradient out;
  out.directions = mirrors.directions;
  auto [node_orbits, nodes_moved] = orbits_of(of_nodes, cells.nodes_per_cell);
  auto [point_orbits, points_moved] = orbits_of(of_points, cells.points);
  std::vector<Orbit> slots = point_orbits;
  for (Orbit& orbit : slots)
    for (int g = 0; g < 1 << orbit.mirrors; ++g) {
      orbit.component[g] = static_cast<int>(out.points.size());
      out.points.push_back(orbit.member[g]);
      orbit.member[g] = orbit.component[g];
    }
  out.slots.resize(out.points.size());
  for (std::size_t slot = 0; slot < out.points.size(); ++slot) out.slots[out.points[slot]] = static_cast<int>(slot);
  int first = 0;
  for (int parity = 0; parity < 1 << of_nodes.size(); ++parity) {
    FoldedGradient::Part part;
    part.first = first;
    std::vector<std::pair<const Orbit*, int>> chosen_nodes;
    for (std::size_t n = 0; n < node_orbits.size(); ++n)
      for (int number = 0; number < 1 << node_orbits[n].mirrors; ++number)
        if (chosen(nodes_moved[n], number) == parity) {
          node_orbits[n].component[number] = first++;
          chosen_nodes.emplace_back(&node_orbits[n], number);
        }
    part.nodes = static_cast<int>(chosen_nodes.size());
    for (int alpha = 0; alpha < d; ++alpha)
      for (std::size_t p = 0; p < slots.size(); ++p)
        for (int number = 0; number < 1 << slots[p].mirrors; ++number) {
          if (chosen(points_moved[p], number) != (parity ^ turned[alpha])) continue;
          part.rows.push_back(slots[p].component[number] * d * d + alpha);
          for (const auto& [orbit, node_number] : chosen_nodes)
            part.backward.push_back(
                static_cast<float>(entry(slopes[alpha], point_orbits[p], number, *orbit, node_number)));
        }
    // A parity that no node has keeps its rows: they are 0, and somebody has to say so.
    for (int n = 0; n < part.nodes; ++n)
      for (std::size_t row = 0; row < part.rows.size(); ++row)
        part.forward.push_back(part.backward[row * part.nodes + n]);
    out.parts.push_back(std::move(part));
  }
  out.node_orbits = std::move(node_orbits);
  out.point_orbits = std::move(slots);
  return out;
}

}  // namespace varimesh
