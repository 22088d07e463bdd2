// Meshes with very many groups.
#pragma once

#include <functional>
#include <numeric>
#include <string>

#include "tests/core/support/meshes.h"

namespace varimesh::testing {

/// A square that is in this many groups.
/// @param name  names the group of a tag
inline HighOrderMesh square_in(int groups, const std::function<std::string(int)>& name) {
  HighOrderMesh mesh = grid(Filling::Quadrilaterals, {1, 1, 0}, 1);
  mesh.blocks[0].physical.resize(std::size_t(groups));
  std::iota(mesh.blocks[0].physical.begin(), mesh.blocks[0].physical.end(), 1);
  for (const int tag : mesh.blocks[0].physical) mesh.physical_groups.push_back({2, tag, name(tag)});
  return mesh;
}
inline HighOrderMesh square_in(int groups) {
  return square_in(groups, [](int tag) { return "g" + std::to_string(tag); });
}

}  // namespace varimesh::testing
