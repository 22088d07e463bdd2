#include "core/kernels/hessian/folded_gradient.h"

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

/// The image of each point under a mirror, as a number among the points; empty if an image is not among them.
Permutation images(const reference::Mirrors& mirrors, int axis, const reference::Points& points) {
  // Solves ξ = origin + directionsᵀ s for s; the mirror changes the sign of component `axis` of s.
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

/// The subset of `mirrors` that the low bits of `number` choose: bit i of `number` stands for the i-th bit that is set
/// in `mirrors`.
int chosen(int mirrors, int number) {
  int set = 0;
  for (int bit = 0; mirrors >> bit != 0; ++bit)
    if ((mirrors >> bit & 1) != 0) {
      set |= (number & 1) << bit;
      number >>= 1;
    }
  return set;
}

double sign(int parity, int image) { return std::popcount(static_cast<unsigned>(parity & image)) % 2 == 0 ? 1 : -1; }

/// The orbits of nodes or points, sorted by size.
struct Orbits {
  std::vector<Orbit> orbits;
  std::vector<int> moved_by;  // by orbit: the mirrors that move its members, as bits
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

/// Entry of the folded operator: from component `node_number` of an orbit of nodes to component `point_number` of an
/// orbit of points, for the derivative `slopes` (points × nodes).
double entry(const Eigen::MatrixXd& slopes, const Orbit& point, int point_number, const Orbit& node, int node_number) {
  double sum = 0;
  for (int h = 0; h < 1 << point.mirrors; ++h)
    for (int g = 0; g < 1 << node.mirrors; ++g)
      sum += sign(point_number, h) * sign(node_number, g) * slopes(point.member[h], node.member[g]);
  return std::ldexp(sum, -point.mirrors - node.mirrors);
}

/// The mirrors of the shape that map the nodes and the points of the cells onto themselves.
struct UsableMirrors {
  std::vector<Permutation> nodes, points;  // by mirror
  std::array<int, 3> reversing{};          // by direction α: the bit of the mirror that reverses it; 0 if none does
};

UsableMirrors usable_mirrors(const CellSet& cells, const reference::Mirrors& mirrors) {
  const reference::Points& nodes =
      reference::nodes(cells.shape, cells.order, reference::NodeSet::Optimised, cells.dimension);
  const reference::Points points = reference::quadrature(cells.shape, cells.order, cells.degree).points;
  UsableMirrors out;
  if (points.rows() != cells.points) return out;  // the set has points of its own
  for (int axis = 0; axis < mirrors.count; ++axis) {
    Permutation node_images = images(mirrors, axis, nodes), point_images = images(mirrors, axis, points);
    if (node_images.empty() || point_images.empty()) continue;
    out.reversing[axis] = 1 << out.nodes.size();
    out.nodes.push_back(std::move(node_images));
    out.points.push_back(std::move(point_images));
  }
  return out;
}

/// ∂φ_n/∂s_α by α: points × nodes.
std::array<Eigen::MatrixXd, 3> slopes_along(const Eigen::MatrixXd& directions, const CellSet& cells) {
  std::array<Eigen::MatrixXd, 3> slopes;
  for (int alpha = 0; alpha < cells.dimension; ++alpha) {
    slopes[alpha].setZero(cells.points, cells.nodes_per_cell);
    for (int n = 0; n < cells.nodes_per_cell; ++n)
      for (int k = 0; k < cells.dimension; ++k)
        slopes[alpha].col(n) +=
            directions(alpha, k) *
            Eigen::Map<const Eigen::VectorXd>(cells.derivatives_of(n) + std::ptrdiff_t{k} * cells.stride, cells.points);
  }
  return slopes;
}

/// Gives each point of the orbits a slot. In the orbits that are kept the members are slots, not points.
void set_slots(const std::vector<Orbit>& point_orbits, FoldedGradient& out) {
  out.point_orbits = point_orbits;
  for (Orbit& orbit : out.point_orbits)
    for (int g = 0; g < 1 << orbit.mirrors; ++g) {
      orbit.component[g] = static_cast<int>(out.points.size());
      out.points.push_back(orbit.member[g]);
      orbit.member[g] = orbit.component[g];
    }
  out.slots.resize(out.points.size());
  for (std::size_t slot = 0; slot < out.points.size(); ++slot) out.slots[out.points[slot]] = static_cast<int>(slot);
}

/// A component at nodes: its orbit and its number there.
using Component = std::pair<const Orbit*, int>;

/// Numbers the components at nodes of one parity, from `first` on.
std::vector<Component> number_components(Orbits& nodes, int parity, int first) {
  std::vector<Component> components;
  for (std::size_t n = 0; n < nodes.orbits.size(); ++n)
    for (int number = 0; number < 1 << nodes.orbits[n].mirrors; ++number) {
      if (chosen(nodes.moved_by[n], number) != parity) continue;
      nodes.orbits[n].component[number] = first + static_cast<int>(components.size());
      components.emplace_back(&nodes.orbits[n], number);
    }
  return components;
}

/// Adds to `parity` the rows of derivative α: the components at points of this parity, and their entries for the
/// components at nodes. `slots`: the orbits of `points`, as FoldedGradient::point_orbits.
void add_rows(const Orbits& points, const std::vector<Orbit>& slots, int parity_of_points,
              const std::vector<Component>& at_nodes, const Eigen::MatrixXd& slopes, int first_row, int rows_per_slot,
              FoldedGradient::Parity& parity) {
  for (std::size_t p = 0; p < slots.size(); ++p)
    for (int number = 0; number < 1 << slots[p].mirrors; ++number) {
      if (chosen(points.moved_by[p], number) != parity_of_points) continue;
      parity.rows.push_back(slots[p].component[number] * rows_per_slot + first_row);
      for (const auto& [orbit, node_number] : at_nodes)
        parity.backward.push_back(static_cast<float>(entry(slopes, points.orbits[p], number, *orbit, node_number)));
    }
}

}  // namespace

FoldedGradient fold_gradient(const CellSet& cells) {
  const int d = cells.dimension;
  const reference::Mirrors mirrors = reference::mirrors(cells.shape);
  const UsableMirrors usable = usable_mirrors(cells, mirrors);
  const std::array<Eigen::MatrixXd, 3> slopes = slopes_along(mirrors.directions, cells);
  Orbits nodes = orbits_of(usable.nodes, cells.nodes_per_cell);
  const Orbits points = orbits_of(usable.points, cells.points);

  FoldedGradient out;
  out.directions = mirrors.directions;
  set_slots(points.orbits, out);
  int first = 0;
  for (int bits = 0; bits < 1 << usable.nodes.size(); ++bits) {
    FoldedGradient::Parity parity;
    const std::vector<Component> components = number_components(nodes, bits, first);
    parity.first = first;
    parity.nodes = static_cast<int>(components.size());
    first += parity.nodes;
    for (int alpha = 0; alpha < d; ++alpha)
      add_rows(points, out.point_orbits, bits ^ usable.reversing[alpha], components, slopes[alpha], alpha, d * d,
               parity);
    // A parity without nodes keeps its rows, since their components at points must still be set, to 0.
    for (int n = 0; n < parity.nodes; ++n)
      for (std::size_t row = 0; row < parity.rows.size(); ++row)
        parity.forward.push_back(parity.backward[row * parity.nodes + n]);
    out.parities.push_back(std::move(parity));
  }
  out.node_orbits = std::move(nodes.orbits);
  return out;
}

}  // namespace varimesh
