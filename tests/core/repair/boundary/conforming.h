// What every change of a boundary must leave: a mesh that conforms, whose boundary has elements, and whose nodes are
// all used.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/check.h"
#include "core/mesh/conformity.h"
#include "core/mesh/connectivity.h"

namespace varimesh::testing {

inline void expect_conforming(const HighOrderMesh& mesh) {
  const auto checked = check_structure(mesh);
  EXPECT_TRUE(checked) << checked.error().sentence;
  const Facets found = facets(mesh);
  EXPECT_LT(found.crowded, 0);
  EXPECT_TRUE(check_conformity(mesh, found, Team(1)));
  // Every facet without a neighbour has an element of its own.
  EXPECT_EQ(std::ranges::count(found.neighbour, -1), static_cast<std::ptrdiff_t>(mesh.element_count(2)));
  std::vector<bool> used(mesh.node_count(), false);
  for (const ElementBlock& block : mesh.blocks)
    for (const std::int32_t node : block.nodes) used[static_cast<std::size_t>(node)] = true;
  EXPECT_EQ(std::ranges::count(used, false), 0);
}

}  // namespace varimesh::testing
