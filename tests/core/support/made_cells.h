// Small meshes for tests: cells of any shape and order, with their nodes placed by a function.
#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <string>

#include "core/mesh/high_order_mesh.h"
#include "core/reference/nodes.h"
#include "tests/core/support/print.h"

namespace varimesh::testing {

using Place = std::array<double, 3>;

inline constexpr Shape kCellShapes[] = {Shape::Triangle, Shape::Quadrilateral, Shape::Tetrahedron,
                                        Shape::Pyramid,  Shape::Prism,         Shape::Hexahedron};

/// A mesh without elements.
inline HighOrderMesh empty_mesh(Shape shape, int order) {
  HighOrderMesh mesh;
  mesh.dimension = reference::info(shape).dimension;
  mesh.order = order;
  return mesh;
}

/// Adds one cell with nodes of its own at map(reference coordinates of the node). Elements and nodes are numbered
/// from 1.
template <class Map>
void add_cell(HighOrderMesh& mesh, Shape shape, Map&& map) {
  const reference::Points& nodes = reference::nodes(shape, mesh.order, reference::NodeSet::Equispaced, mesh.dimension);
  const auto number = static_cast<std::int64_t>(mesh.element_count(mesh.dimension)) + 1;
  if (mesh.blocks.empty() || mesh.blocks.back().shape != shape) {
    ElementBlock block;
    block.shape = shape;
    block.order = mesh.order;
    mesh.blocks.push_back(block);
  }
  ElementBlock& block = mesh.blocks.back();
  block.numbers.push_back(number);
  for (Eigen::Index n = 0; n < nodes.rows(); ++n) {
    Place at{};
    for (Eigen::Index c = 0; c < nodes.cols(); ++c) at[static_cast<std::size_t>(c)] = nodes(n, c);
    block.nodes.push_back(static_cast<std::int32_t>(mesh.node_count()));
    for (const double x : map(at)) mesh.coordinates.push_back(x);
    mesh.node_numbers.push_back(static_cast<std::int64_t>(mesh.node_numbers.size()) + 1);
  }
}

template <class Map>
HighOrderMesh one_cell(Shape shape, int order, Map&& map) {
  HighOrderMesh mesh = empty_mesh(shape, order);
  add_cell(mesh, shape, map);
  return mesh;
}

/// Reference cells with every node moved at random by up to `amount` in each coordinate of the mesh's dimension.
inline HighOrderMesh shaken_cells(Shape shape, int order, int count, double amount, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> shake(-amount, amount);
  HighOrderMesh mesh = empty_mesh(shape, order);
  for (int i = 0; i < count; ++i)
    add_cell(mesh, shape, [&](Place at) {
      for (int c = 0; c < mesh.dimension; ++c) at[static_cast<std::size_t>(c)] += shake(random);
      return at;
    });
  return mesh;
}

inline std::string name(Shape shape) { return std::string(reference::info(shape).name); }

}  // namespace varimesh::testing
