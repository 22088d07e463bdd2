// Meshes of layers along a quarter of a cylinder: where their nodes lie is known.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <vector>

#include "core/base/index.h"
#include "core/layers/layers.h"
#include "core/reference/nodes.h"
#include "core/validity/certifier.h"

namespace varimesh {

constexpr int kAround = 5, kAlong = 2;

/// What the nodes of the layers lie on. Faded: parallel surfaces, which fade to straight sides in the last layer.
enum class Inside { Parallel, StraightSided, Faded };

struct Layers {
  Shape shape;
  int order;
  int count;
  double first, growth;  ///< The height of the first layer, and of each over the one below.
  Inside inside;
  bool bends = true;  ///< Otherwise the wall is flat.

  /// The distance from the wall at a level, which may lie between two layers.
  double height(double level) const {
    const int below = std::min(static_cast<int>(level), count - 1);
    double at_level = 0, of_layer = first;
    for (int layer = 0; layer < below; ++layer, of_layer *= growth) at_level += of_layer;
    return at_level + (level - below) * of_layer;
  }

  std::array<double, 3> place(double angle, double level, double z) const {
    if (!bends) return {angle, height(level), z};
    const double radius = 1 + height(level);
    return {radius * std::sin(angle), radius * std::cos(angle), z};
  }

  /// Position (i, j, k) of the lattice of all nodes: around, across, along.
  std::array<double, 3> node(std::array<int, 3> at) const {
    const double z = 0.3 * at[2] / order, level = static_cast<double>(at[1]) / order;
    const double step = std::acos(-1.0) / 2 / kAround;
    // The planes at both ends of the cylinder are boundaries too, so the layers on them must fit the wall already.
    const bool is_at_end = reference::info(shape).dimension == 3 && (at[2] == 0 || at[2] == kAlong * order);
    if (inside == Inside::Parallel || at[1] == 0 || is_at_end) return place(step * at[0] / order, level, z);
    const int cell = std::min(at[0] / order, kAround - 1);
    const double part = static_cast<double>(at[0]) / order - cell;
    const double share = inside == Inside::Faded ? std::max(0.0, level - (count - 1)) : 1;
    const auto curved = place(step * at[0] / order, level, z);
    const auto a = place(step * cell, level, z), b = place(step * (cell + 1), level, z);
    const auto blend = [&](std::size_t c) {
      return share * ((1 - part) * a[c] + part * b[c]) + (1 - share) * curved[c];
    };
    return {blend(0), blend(1), z};
  }
};

/// Vertices of a cell in the lattice of vertices; a cell's lattice is the linear blend of them.
using Corners = std::vector<std::array<int, 3>>;

inline std::vector<Corners> cells_of(const Layers& layers) {
  std::vector<Corners> cells;
  const bool is_flat = layers.shape == Shape::Quadrilateral || layers.shape == Shape::Triangle;
  for (int i = 0; i < kAround; ++i)
    for (int j = 0; j < layers.count; ++j)
      for (int k = 0; k < (is_flat ? 1 : kAlong); ++k) {
        const std::array<int, 3> a{i, j, k}, b{i + 1, j, k}, c{i + 1, j + 1, k}, d{i, j + 1, k};
        const std::array<int, 3> e{i, j, k + 1}, f{i + 1, j, k + 1}, g{i + 1, j + 1, k + 1}, h{i, j + 1, k + 1};
        if (layers.shape == Shape::Quadrilateral) cells.push_back({a, b, c, d});
        if (layers.shape == Shape::Triangle) cells.insert(cells.end(), {{a, b, d}, {b, c, d}});
        if (layers.shape == Shape::Hexahedron) cells.push_back({a, b, c, d, e, f, g, h});
        if (layers.shape == Shape::Prism) cells.insert(cells.end(), {{a, e, b, d, h, c}, {b, e, f, c, h, g}});
        if (layers.shape == Shape::Tetrahedron)
          cells.insert(cells.end(),
                       {{a, b, d, h}, {a, b, h, e}, {b, h, e, f}, {b, c, d, h}, {b, c, h, g}, {b, h, f, g}});
      }
  return cells;
}

/// The equispaced lattice of a cell between its corners.
inline std::array<int, 3> lattice_node(const Layers& layers, const Corners& corners, std::array<std::int8_t, 3> at) {
  const int p = layers.order;
  std::array<int, 3> node{};
  const auto blend = [&](std::size_t corner, int weight) {
    for (std::size_t c = 0; c < 3; ++c) node[c] += weight * corners[corner][c];
  };
  switch (layers.shape) {
    case Shape::Quadrilateral:
    case Shape::Hexahedron:  // the corners are those of a box
      for (std::size_t c = 0; c < 3; ++c) node[c] = p * corners[0][c] + at[c];
      return node;
    case Shape::Prism: {  // two triangles, one above the other
      for (std::size_t c = 0; c < 3; ++c)
        node[c] = (p - at[0] - at[1]) * corners[0][c] + at[0] * corners[1][c] + at[1] * corners[2][c];
      node[1] += at[2];
      return node;
    }
    default:
      blend(0, p - at[0] - at[1] - at[2]);
      for (std::size_t c = 1; c < corners.size(); ++c) blend(c, at[c - 1]);
      return node;
  }
}

inline HighOrderMesh make(const Layers& layers) {
  HighOrderMesh mesh;
  mesh.dimension = reference::info(layers.shape).dimension;
  mesh.order = layers.order;
  ElementBlock block;
  block.shape = layers.shape;
  block.order = layers.order;
  std::map<std::array<int, 3>, std::int32_t> known;
  for (const Corners& corners : cells_of(layers)) {
    block.numbers.push_back(static_cast<std::int64_t>(block.numbers.size()) + 1);
    for (const auto& at : reference::lattice(layers.shape, layers.order)) {
      const std::array<int, 3> node = lattice_node(layers, corners, at);
      const auto [found, added] = known.try_emplace(node, static_cast<std::int32_t>(known.size()));
      block.nodes.push_back(found->second);
      if (!added) continue;
      for (const double x : layers.node(node)) mesh.coordinates.push_back(x);
      mesh.node_numbers.push_back(found->second + 1);
    }
  }
  mesh.node_blocks = {{-1, 0, 0, static_cast<std::int32_t>(known.size())}};
  mesh.blocks.push_back(std::move(block));
  return mesh;
}

inline std::int64_t uncertified(const HighOrderMesh& mesh, const std::vector<double>& coordinates) {
  const Team team(1);
  std::int64_t count = 0;
  team.run([&] {
    const Certifier certifier(mesh, {}, team);
    std::vector<Certificate> certificates(certifier.cells());
    certifier.certify(coordinates, certificates, team);
    count = std::ranges::count_if(certificates, [](const Certificate& c) { return !c.is_valid(); });
  });
  return count;
}

inline LayerStart start(const HighOrderMesh& mesh, LayerSpacing spacing = LayerSpacing::Keep) {
  const Team team(2);
  LayerStart started;
  team.run([&] {
    const Facets found = facets(mesh, team);
    started = start_layers(mesh, found, fixed_nodes(mesh, found), spacing, OnFlatSides::Slide, team);
  });
  return started;
}

}  // namespace varimesh
