// A solid cylinder of tetrahedra: a geometry and a mesh.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "core/geometry/analytic.h"
#include "core/mesh/high_order_mesh.h"
#include "core/reference/nodes.h"

namespace varimesh::testing {

/// A cylinder of radius 1 and height 1. Surfaces: 1 the side, 2 the bottom, 3 the top. Curves: the two circles.
inline geometry::Geometry solid_cylinder() {
  geometry::Geometry cylinder;
  geometry::Frame top, lower_square, upper_square;
  top.origin = {0, 0, 1};
  lower_square.origin = {-2, -2, 0};
  upper_square.origin = {-2, -2, 1};
  cylinder.curves.push_back({1, geometry::circle({}, 1), {}, {0, 1}});
  cylinder.curves.push_back({2, geometry::circle(top, 1), {}, {0, 2}});
  cylinder.surfaces.push_back({1, geometry::cylinder({}, 1, 1), {0, 1}});
  cylinder.surfaces.push_back({2, geometry::plane(lower_square, 4, 4), {0}});
  cylinder.surfaces.push_back({3, geometry::plane(upper_square, 4, 4), {1}});
  return cylinder;
}

/// Tetrahedra of order P on it: `count`³ cubes in six tetrahedra each, on which the square is mapped to the disc.
/// Boundary nodes lie on the cylinder. Where a corner of the square was, tetrahedra have two faces on its side, which
/// meet at 180°: such a tetrahedron is inverted or has no room.
class DiscMesh {
 public:
  DiscMesh(int count, int order) : count_(count), order_(order) {
    mesh_.dimension = 3;
    mesh_.order = order;
    cells_.shape = Shape::Tetrahedron;
    cells_.order = order;
    cells_.entity = 1;
    for (int tag = 1; tag <= 3; ++tag) {
      sides_[static_cast<std::size_t>(tag - 1)].shape = Shape::Triangle;
      sides_[static_cast<std::size_t>(tag - 1)].order = order;
      sides_[static_cast<std::size_t>(tag - 1)].entity = tag;
    }
    for (int k = 0; k < count; ++k)
      for (int j = 0; j < count; ++j)
        for (int i = 0; i < count; ++i) add_cube({i, j, k});
    mesh_.blocks.assign(sides_.begin(), sides_.end());
    mesh_.blocks.push_back(cells_);
    NodeBlock nodes;
    nodes.count = static_cast<std::int32_t>(mesh_.node_count());
    mesh_.node_blocks.push_back(nodes);
  }
  const HighOrderMesh& mesh() const { return mesh_; }

 private:
  using Place = std::array<int, 3>;  ///< Of a vertex on the grid; of a node, times the order.

  void add_cube(const Place& corner) {
    std::array<int, 3> axes{0, 1, 2};
    do {  // along the edges from the corner to the opposite one, in all orders
      std::array<Place, 4> vertices;
      vertices.fill(corner);
      for (std::size_t k = 1; k < 4; ++k) {
        vertices[k] = vertices[k - 1];
        ++vertices[k][static_cast<std::size_t>(axes[k - 1])];
      }
      const int inversions = (axes[0] > axes[1] ? 1 : 0) + (axes[0] > axes[2] ? 1 : 0) + (axes[1] > axes[2] ? 1 : 0);
      if (inversions % 2 == 1) std::swap(vertices[2], vertices[3]);
      add_cell(vertices);
    } while (std::next_permutation(axes.begin(), axes.end()));
  }

  void add_cell(const std::array<Place, 4>& vertices) {
    const reference::Points& at = reference::nodes(Shape::Tetrahedron, order_, reference::NodeSet::Equispaced, 3);
    std::vector<std::int32_t> nodes;
    for (Eigen::Index n = 0; n < at.rows(); ++n) {
      std::array<double, 4> part{0, 0, 0, 0};
      part[0] = 1;
      for (std::size_t k = 1; k < 4; ++k) {
        part[k] = (1 + at(n, static_cast<Eigen::Index>(k - 1))) / 2;
        part[0] -= part[k];
      }
      nodes.push_back(node(vertices, part));
    }
    cells_.nodes.insert(cells_.nodes.end(), nodes.begin(), nodes.end());
    cells_.numbers.push_back(++elements_);
    for (int facet = 0; facet < 4; ++facet) add_side(nodes, reference::facet_nodes(Shape::Tetrahedron, order_, facet));
  }

  std::int32_t node(const std::array<Place, 4>& vertices, const std::array<double, 4>& part) {
    Place place{};
    Eigen::Vector3d x = Eigen::Vector3d::Zero();
    for (std::size_t v = 0; v < 4; ++v) {
      for (std::size_t k = 0; k < 3; ++k) place[k] += static_cast<int>(std::lround(part[v] * order_)) * vertices[v][k];
      x += part[v] * vertex(vertices[v]);
    }
    const auto [found, is_new] = numbers_.try_emplace(place, static_cast<std::int32_t>(places_.size()));
    if (!is_new) return found->second;
    places_.push_back(place);
    const int last = count_ * order_;
    if (place[0] == 0 || place[0] == last || place[1] == 0 || place[1] == last) x.head<2>().normalize();
    mesh_.coordinates.insert(mesh_.coordinates.end(), {x[0], x[1], place[2] == last ? 1 : x[2]});
    mesh_.node_numbers.push_back(static_cast<std::int64_t>(places_.size()));
    return found->second;
  }

  Eigen::Vector3d vertex(const Place& place) const {
    const double x = 2.0 * place[0] / count_ - 1, y = 2.0 * place[1] / count_ - 1;
    return {x * std::sqrt(1 - y * y / 2), y * std::sqrt(1 - x * x / 2), static_cast<double>(place[2]) / count_};
  }

  void add_side(const std::vector<std::int32_t>& nodes, const std::vector<int>& facet) {
    const int last = count_ * order_;
    const auto all = [&](std::size_t axis, int value) {
      return std::all_of(facet.begin(), facet.end(), [&](int local) {
        return places_[static_cast<std::size_t>(nodes[static_cast<std::size_t>(local)])][axis] == value;
      });
    };
    const int tag = all(2, 0) ? 2 : all(2, last) ? 3 : all(0, 0) || all(0, last) || all(1, 0) || all(1, last) ? 1 : 0;
    if (tag == 0) return;
    ElementBlock& side = sides_[static_cast<std::size_t>(tag - 1)];
    for (const int local : facet) side.nodes.push_back(nodes[static_cast<std::size_t>(local)]);
    side.numbers.push_back(++elements_);
  }

  int count_, order_;
  std::int64_t elements_ = 0;
  HighOrderMesh mesh_;
  ElementBlock cells_;
  std::array<ElementBlock, 3> sides_;
  std::map<Place, std::int32_t> numbers_;
  std::vector<Place> places_;
};

}  // namespace varimesh::testing
