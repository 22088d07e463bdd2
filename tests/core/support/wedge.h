// A wedge between a plane and a cylinder, and one tetrahedron in it.
#pragma once

#include <array>
#include <cmath>
#include <memory>
#include <numbers>

#include "core/mesh/high_order_mesh.h"
#include "tests/core/support/split_pipe.h"

namespace varimesh::testing {

/// A plane and a cylinder that meet along the z axis at this angle, in radians, and the floor on which both stand.
inline geometry::Geometry wedge(double angle) {
  const Eigen::Vector3d along(std::cos(angle), -std::sin(angle), 0);
  const double end = std::numbers::pi / 3;
  geometry::Geometry model;
  geometry::Frame side, round, floor;
  side.axes << along, Eigen::Vector3d::UnitZ(), along.cross(Eigen::Vector3d::UnitZ());
  round.origin = {0, 1, 0};
  floor.origin = {-2, -2, 0};
  model.vertices = {{1, {0, 0, 0}}, {2, {0, 0, 1}}, {3, 0.8 * along}, {4, {std::sin(end), 1 - std::cos(end), 0}}};
  model.curves.push_back({1, geometry::line({0, 0, 0}, {0, 0, 1}), {0, 1}, {0, 1}});
  model.curves.push_back({2, geometry::line({0, 0, 0}, 0.8 * along), {0, 2}, {0, 2}});
  model.curves.push_back(
      {3,
       std::make_shared<PartOfCurve>(geometry::circle(round, 1), -std::numbers::pi / 2, -std::numbers::pi / 2 + end),
       {0, 3},
       {1, 2}});
  model.surfaces.push_back({1, geometry::plane(side, 2, 1), {0, 1}});
  model.surfaces.push_back({2, geometry::cylinder(round, 1, 1), {0, 2}, "Hole"});
  model.surfaces.push_back({3, geometry::plane(floor, 4, 4), {1, 2}});
  return model;
}

/// One tetrahedron, number 7, with an edge on each curve.
inline HighOrderMesh in_wedge(const geometry::Geometry& model) {
  HighOrderMesh mesh;
  mesh.dimension = 3;
  mesh.order = 1;
  for (const geometry::Vertex& vertex : model.vertices) {
    mesh.coordinates.insert(mesh.coordinates.end(), {vertex.x[0], vertex.x[1], vertex.x[2]});
    mesh.node_numbers.push_back(vertex.tag);
  }
  constexpr std::array<std::array<std::int32_t, 3>, 3> kFaces{{{0, 1, 2}, {0, 1, 3}, {0, 2, 3}}};
  for (int face = 0; face < 3; ++face) {
    ElementBlock block;
    block.shape = Shape::Triangle;
    block.entity = face + 1;
    block.nodes.assign(kFaces[static_cast<std::size_t>(face)].begin(), kFaces[static_cast<std::size_t>(face)].end());
    block.numbers = {face + 1};
    mesh.blocks.push_back(block);
  }
  ElementBlock cells;
  cells.shape = Shape::Tetrahedron;
  cells.entity = 1;
  cells.nodes = {0, 2, 3, 1};
  cells.numbers = {7};
  mesh.blocks.push_back(cells);
  NodeBlock nodes;
  nodes.count = 4;
  mesh.node_blocks.push_back(nodes);
  return mesh;
}

}  // namespace varimesh::testing
