// A strip of triangles that are valid only by their curved sides.
#pragma once

#include <cmath>

#include "core/mesh/changes/change_order.h"
#include "tests/core/support/meshes.h"

namespace varimesh::testing {

/// Part of an annulus between the radii 1 and `outer`, 60° per sector, filled with one layer of curved triangles. The
/// vertices of the outer circle lie halfway between those of the inner one. If `outer` is less than 1/cos 30° = 1.155,
/// the triangles with an edge on the outer circle (elements 2, 4, …) are inverted with straight sides, because the
/// chord passes below the inner vertex. The others (1, 3, …) never are.
inline HighOrderMesh curved_strip(double outer, int order, int sectors = 3) {
  HighOrderMesh mesh;
  mesh.dimension = 2;
  mesh.order = 1;
  const double half = 3.14159265358979323846 / 6;
  for (int i = 0; i <= 2 * sectors; ++i) {  // even: inner circle, odd: outer circle; as (angle, radius)
    for (const double x : {i * half, i % 2 == 0 ? 1.0 : outer, 0.0}) mesh.coordinates.push_back(x);
    mesh.node_numbers.push_back(i + 1);
  }
  mesh.node_blocks.push_back({-1, 0, 0, static_cast<std::int32_t>(mesh.node_count())});
  ElementBlock block;
  block.shape = Shape::Triangle;
  block.entity = 1;
  for (int i = 0; i + 2 <= 2 * sectors; ++i) {
    block.numbers.push_back(i + 1);
    // Clockwise in (angle, radius), so counter-clockwise in the plane.
    const bool inner = i % 2 == 0;
    for (const int node : {i, inner ? i + 1 : i + 2, inner ? i + 2 : i + 1}) block.nodes.push_back(node);
  }
  mesh.blocks.push_back(block);
  HighOrderMesh curved = *change_order(mesh, order);
  move_nodes(curved, [](Place p) { return Place{p[1] * std::cos(p[0]), p[1] * std::sin(p[0]), 0}; });
  return curved;
}

}  // namespace varimesh::testing
