// A grid of quadrilaterals on a surface of a geometry, with nodes where a function of two numbers puts them.
#pragma once

#include <functional>
#include <map>

#include "core/geometry/geometry.h"
#include "core/mesh/high_order_mesh.h"
#include "core/reference/nodes.h"

namespace varimesh::testing {

/// columns × rows quadrilaterals with the tag `tag`. `at` maps (s, t) in [0, 1]² to parameters. The grid closes on
/// itself in s, and in t if `closed_in_t`.
inline HighOrderMesh surface_grid(const geometry::SurfaceShape& shape, int columns, int rows, int order, int tag,
                                  bool closed_in_t, const std::function<std::array<double, 2>(double, double)>& at) {
  HighOrderMesh mesh;
  mesh.dimension = 2;
  mesh.order = order;
  std::map<std::pair<int, int>, std::int32_t> numbers;
  ElementBlock block;
  block.shape = Shape::Quadrilateral;
  block.order = order;
  block.entity = tag;
  for (int i = 0; i < columns; ++i)
    for (int j = 0; j < rows; ++j) {
      block.numbers.push_back(static_cast<std::int64_t>(block.numbers.size()) + 1);
      for (const auto& place : reference::lattice(Shape::Quadrilateral, order)) {
        const int s = (i * order + place[0]) % (columns * order);
        int t = j * order + place[1];
        if (closed_in_t) t %= rows * order;
        const auto [number, is_new] = numbers.try_emplace({s, t}, static_cast<std::int32_t>(mesh.node_numbers.size()));
        if (is_new) {
          const std::array<double, 2> p =
              at(static_cast<double>(s) / (columns * order), static_cast<double>(t) / (rows * order));
          const Eigen::Vector3d x = shape.at(p[0], p[1]).x;
          mesh.coordinates.insert(mesh.coordinates.end(), x.data(), x.data() + 3);
          mesh.node_numbers.push_back(number->second + 1);
        }
        block.nodes.push_back(number->second);
      }
    }
  mesh.blocks.push_back(std::move(block));
  mesh.node_blocks = {{-1, 0, 0, static_cast<std::int32_t>(mesh.node_count())}};
  return mesh;
}

}  // namespace varimesh::testing
