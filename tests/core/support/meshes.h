// Structured meshes for tests, of any shape, mixture and order, and ways to deform them.
#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <functional>
#include <ostream>
#include <random>
#include <string>
#include <vector>

#include "core/mesh/changes/change_order.h"
#include "core/mesh/connectivity.h"
#include "core/mesh/high_order_mesh.h"
#include "tests/core/support/print.h"

namespace varimesh::testing {

using Place = std::array<double, 3>;
using Map = std::function<Place(Place)>;

/// The cells that fill a grid's squares or cubes. Every mesh conforms.
enum class Filling {
  Quadrilaterals,
  Triangles,   ///< Two per square.
  MixedPlane,  ///< Columns of squares alternate with columns of split squares.
  Hexahedra,
  Prisms,      ///< Two per cube.
  Pyramids,    ///< Six per cube, around its centre.
  Tetrahedra,  ///< Twelve per cube, around its centre.
  MixedSolid,  ///< Columns in x: hexahedra, pyramids and tetrahedra, prisms, pyramids and tetrahedra, …
};

inline constexpr Filling kFillings[] = {Filling::Quadrilaterals, Filling::Triangles, Filling::MixedPlane,
                                        Filling::Hexahedra,      Filling::Prisms,    Filling::Pyramids,
                                        Filling::Tetrahedra,     Filling::MixedSolid};

inline bool is_plane(Filling filling) { return filling <= Filling::MixedPlane; }

inline const char* name(Filling filling) {
  constexpr const char* kNames[] = {"Quadrilaterals", "Triangles", "MixedPlane", "Hexahedra",
                                    "Prisms",         "Pyramids",  "Tetrahedra", "MixedSolid"};
  return kNames[static_cast<int>(filling)];
}

inline void PrintTo(Filling filling, std::ostream* out) { *out << name(filling); }

/// Makes a linear grid on the unit square or cube.
class GridMaker {
 public:
  GridMaker(Filling filling, std::array<int, 3> counts) : filling_(filling), n_(counts) {
    if (is_plane(filling)) n_[2] = 0;
    mesh_.dimension = is_plane(filling) ? 2 : 3;
    mesh_.order = 1;
    for (int k = 0; k <= n_[2]; ++k)
      for (int j = 0; j <= n_[1]; ++j)
        for (int i = 0; i <= n_[0]; ++i)
          add_node({double(i) / n_[0], double(j) / n_[1], n_[2] > 0 ? double(k) / n_[2] : 0.0});
    for (int k = 0; k < std::max(n_[2], 1); ++k)
      for (int j = 0; j < n_[1]; ++j)
        for (int i = 0; i < n_[0]; ++i) is_plane(filling) ? add_square(i, j) : add_cube(i, j, k);
    mesh_.node_blocks = {{-1, 0, 0, std::int32_t(mesh_.node_count())}};
    mark_boundary();
  }

  HighOrderMesh take() { return std::move(mesh_); }

 private:
  enum class Kind { Hexahedron, Prism, Centre };

  std::int32_t add_node(Place at) {
    mesh_.coordinates.insert(mesh_.coordinates.end(), at.begin(), at.end());
    mesh_.node_numbers.push_back(std::int64_t(mesh_.node_numbers.size()) + 1);
    return std::int32_t(mesh_.node_numbers.size()) - 1;
  }

  std::int32_t corner(int i, int j, int k) const { return i + (n_[0] + 1) * (j + (n_[1] + 1) * k); }

  void add_element(Shape shape, const std::vector<std::int32_t>& nodes, int entity = 1, std::vector<int> groups = {}) {
    auto block = std::find_if(mesh_.blocks.begin(), mesh_.blocks.end(), [&](const ElementBlock& b) {
      return b.shape == shape && b.entity == entity && b.physical == groups;
    });
    if (block == mesh_.blocks.end()) {
      ElementBlock fresh;
      fresh.shape = shape;
      fresh.entity = entity;
      fresh.physical = std::move(groups);
      block = mesh_.blocks.insert(mesh_.blocks.end(), fresh);
    }
    block->numbers.push_back(++elements_);
    block->nodes.insert(block->nodes.end(), nodes.begin(), nodes.end());
  }

  void add_square(int i, int j) {
    const std::int32_t a = corner(i, j, 0), b = corner(i + 1, j, 0), c = corner(i + 1, j + 1, 0),
                       d = corner(i, j + 1, 0);
    const bool split = filling_ == Filling::Triangles || (filling_ == Filling::MixedPlane && i % 2 == 1);
    if (!split) return add_element(Shape::Quadrilateral, {a, b, c, d});
    add_element(Shape::Triangle, {a, b, c});
    add_element(Shape::Triangle, {a, c, d});
  }

  Kind kind(int i) const {
    switch (filling_) {
      case Filling::Hexahedra:
        return Kind::Hexahedron;
      case Filling::Prisms:
        return Kind::Prism;
      case Filling::MixedSolid:
        return i % 4 == 0 ? Kind::Hexahedron : i % 4 == 2 ? Kind::Prism : Kind::Centre;
      default:
        return Kind::Centre;
    }
  }

  // Whether a cube with a centre keeps its square face on that side of direction `axis`. Columns are alike in y and z.
  bool keeps_square(int i, int axis, int side) const {
    if (filling_ == Filling::Pyramids) return true;
    if (filling_ != Filling::MixedSolid || axis != 0) return false;
    const int next = i + side;
    return next >= 0 && next < n_[0] && kind(next) != Kind::Centre;
  }

  void add_cube(int i, int j, int k) {
    std::array<std::int32_t, 8> v;
    for (int z = 0; z < 2; ++z) {
      const std::array<std::int32_t, 4> layer{corner(i, j, k + z), corner(i + 1, j, k + z), corner(i + 1, j + 1, k + z),
                                              corner(i, j + 1, k + z)};
      std::copy(layer.begin(), layer.end(), v.begin() + 4 * z);
    }
    if (kind(i) == Kind::Hexahedron) return add_element(Shape::Hexahedron, {v.begin(), v.end()});
    if (kind(i) == Kind::Prism) {
      add_element(Shape::Prism, {v[0], v[1], v[2], v[4], v[5], v[6]});
      add_element(Shape::Prism, {v[0], v[2], v[3], v[4], v[6], v[7]});
      return;
    }
    const std::int32_t centre = add_node({(i + 0.5) / n_[0], (j + 0.5) / n_[1], (k + 0.5) / n_[2]});
    // Faces with their normals inward. Each begins at its lowest corner, where its diagonal begins too.
    constexpr std::array<std::array<int, 4>, 6> kFaces{
        {{0, 3, 7, 4}, {1, 5, 6, 2}, {0, 4, 5, 1}, {3, 2, 6, 7}, {0, 1, 2, 3}, {4, 7, 6, 5}}};
    for (std::size_t f = 0; f < 6; ++f) {
      const std::int32_t a = v[std::size_t(kFaces[f][0])], b = v[std::size_t(kFaces[f][1])],
                         c = v[std::size_t(kFaces[f][2])], d = v[std::size_t(kFaces[f][3])];
      if (keeps_square(i, int(f / 2), f % 2 == 0 ? -1 : 1)) {
        add_element(Shape::Pyramid, {a, b, c, d, centre});
      } else {
        add_element(Shape::Tetrahedron, {a, b, c, centre});
        add_element(Shape::Tetrahedron, {a, c, d, centre});
      }
    }
  }

  // Boundary elements on each side of the square or cube: entities, tags and groups 1 to 6 for x = 0, x = 1, y = 0, ….
  void mark_boundary() {
    constexpr const char* kSides[] = {"left", "right", "front", "back", "bottom", "top"};
    const int d = mesh_.dimension;
    for (int side = 0; side < 2 * d; ++side) mesh_.physical_groups.push_back({d - 1, side + 1, kSides[side]});
    const HighOrderMesh cells_only = mesh_;
    const Cells cells(cells_only, d);
    const Facets all = facets(cells_only);
    for (std::size_t cell = 0; cell < cells.count(); ++cell)
      for (std::int32_t f = all.first[cell]; f < all.first[cell + 1]; ++f) {
        if (all.neighbour[std::size_t(f)] >= 0) continue;
        const reference::Facet& facet = reference::info(cells.shape(cell)).facets[std::size_t(f - all.first[cell])];
        std::vector<std::int32_t> nodes;
        for (const std::int8_t v : facet.vertices)
          if (v >= 0) nodes.push_back(cells.nodes(cell)[std::size_t(v)]);
        for (int side = 0; side < 2 * d; ++side) {
          const bool on_side = std::all_of(nodes.begin(), nodes.end(), [&](std::int32_t n) {
            return mesh_.coordinates[3 * std::size_t(n) + std::size_t(side / 2)] == side % 2;
          });
          if (on_side) add_element(facet.shape, nodes, side + 1, {side + 1});
        }
      }
  }

  Filling filling_;
  std::array<int, 3> n_;
  HighOrderMesh mesh_;
  std::int64_t elements_ = 0;
};

/// Moves every node to where `map` sends it.
inline void move_nodes(HighOrderMesh& mesh, const Map& map) {
  for (std::size_t n = 0; n < mesh.node_count(); ++n) {
    double* x = mesh.coordinates.data() + 3 * n;
    const Place to = map({x[0], x[1], x[2]});
    std::copy(to.begin(), to.end(), x);
  }
}

/// A straight-sided mesh of order `order` on the unit square or cube, with its vertices moved by `map`. Its boundary
/// elements are in the groups "left", "right" (x = 0, 1), "front", "back" (y) and in 3-D "bottom", "top" (z), with tags
/// 1 to 6 in that order; elements and nodes are numbered from 1.
inline HighOrderMesh grid(Filling filling, std::array<int, 3> counts, int order, const Map& map = {}) {
  HighOrderMesh mesh = GridMaker(filling, counts).take();
  if (map) move_nodes(mesh, map);
  return *change_order(mesh, order);
}

/// A map that bends the unit cube a little. No two cells of a bent grid are alike.
inline Map bent(int dimension, double amount = 0.08) {
  return [=](Place at) {
    const auto [x, y, z] = at;
    const double pi = 3.14159265358979323846;
    const double third = dimension == 3 ? std::cos(pi * z) : 1.0;
    return Place{x + amount * std::sin(pi * y + 0.3) * third, y + amount * std::sin(pi * x + 0.7) * third,
                 dimension == 3 ? z + amount * std::sin(pi * x) * std::cos(pi * y) : z};
  };
}

/// Whether each node is a vertex of a cell.
inline std::vector<bool> vertex_nodes(const HighOrderMesh& mesh) {
  std::vector<bool> vertex(mesh.node_count(), false);
  const Cells cells(mesh, mesh.dimension);
  for (std::size_t cell = 0; cell < cells.count(); ++cell)
    for (int v = 0; v < reference::info(cells.shape(cell)).vertices; ++v)
      vertex[std::size_t(cells.nodes(cell)[std::size_t(v)])] = true;
  return vertex;
}

enum class Shaken { AllInterior, NotVertices };

/// Moves every free node at random by up to `amount` in each direction of the mesh. With NotVertices the vertices stay,
/// and so do the straight-sided cells.
inline void shake(HighOrderMesh& mesh, double amount, unsigned seed, Shaken which = Shaken::NotVertices) {
  const std::vector<bool> fixed = fixed_nodes(mesh);
  const std::vector<bool> vertex = vertex_nodes(mesh);
  std::mt19937 random(seed);
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    for (int k = 0; k < mesh.dimension; ++k) {
      // std::uniform_real_distribution would differ from one standard library to another.
      const double move = amount * (2.0 * double(random()) / double(std::mt19937::max()) - 1.0);
      if (!fixed[n] && !(vertex[n] && which == Shaken::NotVertices)) mesh.coordinates[3 * n + std::size_t(k)] += move;
    }
}

/// Largest difference between the coordinates of two meshes with the same nodes.
inline double distance(const HighOrderMesh& a, const HighOrderMesh& b) {
  assert(a.coordinates.size() == b.coordinates.size());
  double largest = 0;
  for (std::size_t i = 0; i < a.coordinates.size(); ++i)
    largest = std::max(largest, std::abs(a.coordinates[i] - b.coordinates[i]));
  return largest;
}

/// All nodes on a side, ascending: 1 is x = 0, 2 is x = 1, and so on.
inline std::vector<std::int32_t> side_nodes(const HighOrderMesh& mesh, int side) {
  std::vector<std::int32_t> nodes;
  for (const ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == mesh.dimension - 1 && block.entity == side)
      nodes.insert(nodes.end(), block.nodes.begin(), block.nodes.end());
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

}  // namespace varimesh::testing
