// A plane ring: a mesh of order 1 between concentric circles.
#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "core/mesh/high_order_mesh.h"

namespace varimesh::testing {

/// Rows of elements between circles with these radii around the origin, in z = 0. Each row has its own tag, from 1.
/// Node i + columns * row lies on the circle `row` at i / columns of a turn.
/// @param triangles  cuts each quadrilateral in two
inline HighOrderMesh ring_mesh(const std::vector<double>& radii, int columns, bool triangles = false) {
  HighOrderMesh mesh;
  mesh.dimension = 2;
  mesh.order = 1;
  for (const double radius : radii)
    for (int i = 0; i < columns; ++i) {
      const double angle = 2 * std::numbers::pi * i / columns;
      for (const double x : {radius * std::cos(angle), radius * std::sin(angle), 0.0}) mesh.coordinates.push_back(x);
      mesh.node_numbers.push_back(std::ssize(mesh.node_numbers) + 1);
    }
  std::int64_t number = 0;
  for (int row = 0; row + 1 < static_cast<int>(radii.size()); ++row) {
    ElementBlock& block = mesh.blocks.emplace_back();
    block.shape = triangles ? Shape::Triangle : Shape::Quadrilateral;
    block.entity = row + 1;
    for (int i = 0; i < columns; ++i) {
      const int a = row * columns + i, b = row * columns + (i + 1) % columns, c = b + columns, d = a + columns;
      const std::vector<std::int32_t> nodes =
          triangles ? std::vector<std::int32_t>{a, d, b, b, d, c} : std::vector<std::int32_t>{a, d, c, b};
      block.nodes.insert(block.nodes.end(), nodes.begin(), nodes.end());
      for (int k = 0; k < (triangles ? 2 : 1); ++k) block.numbers.push_back(++number);
    }
  }
  return mesh;
}

}  // namespace varimesh::testing
