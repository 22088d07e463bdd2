// Meshes on which layers grow, and what must hold of what has grown.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "core/layers/grow/grow_layer.h"
#include "core/mesh/changes/to_simplices.h"
#include "core/validity/certifier.h"
#include "tests/core/layers/split_meshes.h"

namespace varimesh {

inline Expected<GrownLayer> grow(const HighOrderMesh& mesh, double thickness, int threads = 1,
                                 const std::vector<std::string>& walls = {"7"}) {
  const Team team(threads);
  const auto checked = check_mesh(mesh, CheckFor::Judging, team);
  if (!checked) return tl::unexpected(checked.error());
  return grow_layer(*checked, walls, thickness, team);
}

/// A box or rectangle of simplices with the wall at y = 0.
inline HighOrderMesh simplices(
    int around, int across, int order, bool flat,
    const std::function<int(const Place&)>& tag_of = [](const Place& x) { return x[1] < 1e-9 ? 7 : 8; }) {
  const HighOrderMesh cells =
      box(flat ? Shape::Quadrilateral : Shape::Hexahedron, around, across, flat ? 1 : around, tag_of);
  return *change_order(*to_simplices(cells), order);
}

inline std::int64_t uncertified(const HighOrderMesh& mesh) {
  std::int64_t count = 0;
  const Team team(1);
  team.run([&] {
    const Certifier certifier(mesh, {}, team);
    std::vector<Certificate> certificates(certifier.cells());
    certifier.certify(mesh.coordinates, certificates, team);
    count = std::ranges::count_if(certificates, [](const Certificate& one) { return !one.is_valid(); });
  });
  return count;
}

/// The result is conforming, every facet of its boundary has an element, and the nodes of the wall are where they were.
inline void expect_sound(const HighOrderMesh& before, const HighOrderMesh& after) {
  const auto checked = check_mesh(after, CheckFor::Optimising, Team(1));
  ASSERT_TRUE(checked) << checked.error().sentence;
  EXPECT_EQ(uncertified(after), 0);
  std::set<std::int32_t> with_element;
  for (const auto& [facet, element] : checked->facets.elements) with_element.insert(facet);
  for (std::size_t facet = 0; facet < checked->facets.neighbour.size(); ++facet)
    if (checked->facets.neighbour[facet] < 0) {
      EXPECT_TRUE(with_element.contains(static_cast<std::int32_t>(facet))) << facet;
    }
  for (const ElementBlock& block : before.blocks) {
    if (block.entity != 7 || reference::info(block.shape).dimension != before.dimension - 1) continue;
    for (const std::int32_t node : block.nodes)
      for (std::size_t c = 0; c < 3; ++c)
        EXPECT_EQ(after.coordinates[3 * at(node) + c], before.coordinates[3 * at(node) + c]);
  }
}

}  // namespace varimesh
