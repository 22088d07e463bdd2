// Small meshes with walls, and their volumes.
#pragma once

#include <Eigen/Core>
#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <set>
#include <utility>
#include <vector>

#include "core/base/index.h"
#include "core/layers/split/split_layers.h"
#include "core/mesh/changes/change_order.h"
#include "core/mesh/check.h"
#include "core/mesh/checked_mesh.h"
#include "core/reference/basis.h"
#include "core/reference/quadrature.h"

namespace varimesh {

using Place = std::array<double, 3>;
struct SmallCell {
  Shape shape;
  std::vector<std::int32_t> vertices;
};

/// A mesh of order 1 with all its boundary elements. `tag_of` gives the entity of a boundary element at its centre.
inline HighOrderMesh small_mesh(const std::vector<Place>& places, const std::vector<SmallCell>& cells,
                                const std::function<int(const Place&)>& tag_of) {
  HighOrderMesh mesh;
  mesh.dimension = reference::info(cells[0].shape).dimension;
  mesh.order = 1;
  for (const Place& x : places) mesh.coordinates.insert(mesh.coordinates.end(), x.begin(), x.end());
  for (std::size_t n = 0; n < places.size(); ++n) mesh.node_numbers.push_back(static_cast<std::int64_t>(n) + 1);
  mesh.node_blocks = {{-1, 0, 0, static_cast<std::int32_t>(places.size())}};
  std::int64_t number = 0;
  std::map<std::set<std::int32_t>, std::pair<Shape, std::vector<std::int32_t>>> boundary;
  std::map<Shape, ElementBlock> blocks;
  const auto put = [&](ElementBlock& block, Shape shape, int entity, const std::vector<std::int32_t>& nodes) {
    block.shape = shape;
    block.order = 1;
    block.entity = entity;
    block.numbers.push_back(++number);
    block.nodes.insert(block.nodes.end(), nodes.begin(), nodes.end());
  };
  for (const SmallCell& cell : cells) {
    put(blocks[cell.shape], cell.shape, 1, cell.vertices);
    for (const reference::Facet& facet : reference::info(cell.shape).facets) {
      std::vector<std::int32_t> nodes;
      for (const int v : facet.vertices)
        if (v >= 0) nodes.push_back(cell.vertices[at(v)]);
      const std::set<std::int32_t> key(nodes.begin(), nodes.end());
      if (boundary.erase(key) == 0) boundary[key] = {facet.shape, nodes};
    }
  }
  std::map<std::pair<int, Shape>, ElementBlock> sides;
  for (const auto& [key, facet] : boundary) {
    Place centre{};
    for (const std::int32_t node : facet.second)
      for (std::size_t c = 0; c < 3; ++c) centre[c] += places[at(node)][c] / static_cast<double>(facet.second.size());
    const int tag = tag_of(centre);
    put(sides[{tag, facet.first}], facet.first, tag, facet.second);
  }
  for (auto& [name, block] : sides) mesh.blocks.push_back(std::move(block));
  for (auto& [shape, block] : blocks) mesh.blocks.push_back(std::move(block));
  return mesh;
}

/// The mesh with this order, and bent.
inline HighOrderMesh bent(const HighOrderMesh& straight, int order, double by = 0.04) {
  HighOrderMesh mesh = *change_order(straight, order);
  const bool flat = mesh.dimension == 2;
  for (std::size_t n = 0; n < mesh.node_count(); ++n) {
    double* x = &mesh.coordinates[3 * n];
    const double a = x[0], b = x[1], c = x[2];
    x[0] += by * std::sin(2 * b + c);
    x[1] += by * std::sin(2 * a + 1 + c) + by * a * b;
    if (!flat) x[2] += by * std::sin(a + 2 * b);
  }
  return mesh;
}

/// Area or volume of the cells of a shape, or of all.
inline double volume(const HighOrderMesh& mesh) {
  double sum = 0;
  const Cells cells(mesh, mesh.dimension);
  for (std::size_t cell = 0; cell < cells.count(); ++cell) {
    const reference::Quadrature rule = reference::quadrature(cells.shape(cell), mesh.order, 3 * mesh.order + 2);
    const auto gradients = reference::basis_gradients(cells.shape(cell), mesh.order, reference::NodeSet::Equispaced,
                                                      mesh.dimension, rule.points);
    Eigen::MatrixXd x(static_cast<Eigen::Index>(cells.nodes(cell).size()), mesh.dimension);
    for (Eigen::Index n = 0; n < x.rows(); ++n)
      for (Eigen::Index c = 0; c < x.cols(); ++c) x(n, c) = mesh.coordinates[3 * at(cells.nodes(cell)[at(n)]) + at(c)];
    for (Eigen::Index q = 0; q < rule.weights.size(); ++q) {
      Eigen::MatrixXd jacobian(mesh.dimension, mesh.dimension);
      for (int d = 0; d < mesh.dimension; ++d) jacobian.row(d) = gradients[at(d)].row(q) * x;
      sum += rule.weights[q] * jacobian.determinant();
    }
  }
  return sum;
}

/// A box of hexahedra or prisms, or a rectangle of quadrilaterals, over [0, 1]³, with the wall, entity 7, at y = 0 and
/// the rest of the boundary as entity 8.
inline HighOrderMesh box(
    Shape shape, int around, int across, int along = 1,
    const std::function<int(const Place&)>& tag_of = [](const Place& x) { return x[1] < 1e-9 ? 7 : 8; }) {
  const bool flat = shape == Shape::Quadrilateral;
  std::vector<Place> places;
  const auto index = [&](int i, int j, int k) { return (k * (across + 1) + j) * (around + 1) + i; };
  for (int k = 0; k <= (flat ? 0 : along); ++k)
    for (int j = 0; j <= across; ++j)
      for (int i = 0; i <= around; ++i)
        places.push_back({1.0 * i / around, 1.0 * j / across, flat ? 0 : 1.0 * k / along});
  std::vector<SmallCell> cells;
  for (int k = 0; k < (flat ? 1 : along); ++k)
    for (int j = 0; j < across; ++j)
      for (int i = 0; i < around; ++i) {
        const auto v = [&](int x, int y, int z) { return index(i + x, j + y, k + z); };
        if (flat) cells.push_back({shape, {v(0, 0, 0), v(1, 0, 0), v(1, 1, 0), v(0, 1, 0)}});
        if (shape == Shape::Hexahedron)
          cells.push_back(
              {shape,
               {v(0, 0, 0), v(1, 0, 0), v(1, 1, 0), v(0, 1, 0), v(0, 0, 1), v(1, 0, 1), v(1, 1, 1), v(0, 1, 1)}});
        if (shape == Shape::Prism) {
          cells.push_back({shape, {v(0, 0, 0), v(0, 0, 1), v(1, 0, 0), v(0, 1, 0), v(0, 1, 1), v(1, 1, 0)}});
          cells.push_back({shape, {v(1, 0, 1), v(1, 0, 0), v(0, 0, 1), v(1, 1, 1), v(1, 1, 0), v(0, 1, 1)}});
        }
      }
  return small_mesh(places, cells, tag_of);
}

inline Expected<SplitLayers> split(const HighOrderMesh& mesh, const LayerOptions& wanted, int threads = 1) {
  const Team team(threads);
  const auto checked = check_mesh(mesh, CheckFor::Judging, team);
  if (!checked) return tl::unexpected(checked.error());
  return split_layers(*checked, wanted, team);
}

inline LayerOptions geometric(int layers, double growth, LayerSpacing spacing = LayerSpacing::Even) {
  LayerOptions wanted;
  wanted.walls = {"7"};
  wanted.layers = layers;
  wanted.growth = growth;
  wanted.spacing = spacing;
  return wanted;
}

}  // namespace varimesh
