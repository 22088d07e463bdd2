// Several threads find the same facets and report the same fault as one.
#include <gtest/gtest.h>

#include <limits>

#include "core/base/team.h"
#include "core/mesh/bounding_box.h"
#include "core/mesh/check.h"
#include "core/mesh/connectivity.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

constexpr int kThreads[] = {2, 3, 8};

// Large enough for several tasks per loop.
HighOrderMesh mesh_of(Filling filling, int order = 2) {
  HighOrderMesh mesh = testing::is_plane(filling) ? testing::grid(filling, {90, 80, 0}, order)
                                                  : testing::grid(filling, {16, 15, 14}, order);
  testing::shake(mesh, 0.01, 1);
  return mesh;
}

struct Checked {
  std::string sentence;
  Facets facets;
};

Checked checked_by(const HighOrderMesh& mesh, int threads) {
  const Team team(threads);
  Checked result;
  team.run([&] {
    const Expected<void> done = check_structure(mesh, team, &result.facets);
    if (!done) result.sentence = done.error().sentence;
  });
  return result;
}

void expect_same(const HighOrderMesh& mesh, const std::string& part_of_sentence) {
  const Checked one = checked_by(mesh, 1);
  if (part_of_sentence.empty())
    EXPECT_EQ(one.sentence, "");
  else
    EXPECT_NE(one.sentence.find(part_of_sentence), std::string::npos) << one.sentence;
  for (const int threads : kThreads) {
    const Checked several = checked_by(mesh, threads);
    EXPECT_EQ(several.sentence, one.sentence) << threads << " threads";
    EXPECT_EQ(several.facets.first, one.facets.first);
    EXPECT_EQ(several.facets.neighbour, one.facets.neighbour);
    EXPECT_EQ(several.facets.opposite, one.facets.opposite);
    EXPECT_EQ(several.facets.elements, one.facets.elements);
  }
}

class SharedChecks : public ::testing::TestWithParam<Filling> {};

INSTANTIATE_TEST_SUITE_P(Fillings, SharedChecks, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return testing::name(info.param); });

TEST_P(SharedChecks, FindTheSameFacets) { expect_same(mesh_of(GetParam()), ""); }

// The faults are in several tasks, and the first in the order of the file is reported.
template <class Damage>
void expect_same_fault(Filling filling, const std::string& sentence, const Damage& damage) {
  for (const double first : {0.3, 0.9}) {
    HighOrderMesh mesh = mesh_of(filling);
    std::size_t block = 0;
    while (reference::info(mesh.blocks[block].shape).dimension != mesh.dimension) ++block;
    for (const double place : {first, 0.95, 0.99})
      damage(mesh, mesh.blocks[block],
             static_cast<std::size_t>(place * static_cast<double>(mesh.blocks[block].size())));
    expect_same(mesh, sentence);
  }
}

TEST(SharedFaults, ReportTheFirstCoordinateThatIsNotFinite) {
  expect_same_fault(Filling::Tetrahedra, "is not a finite number (3 such nodes in all)",
                    [](HighOrderMesh& mesh, ElementBlock& block, std::size_t e) {
                      mesh.coordinates[3 * static_cast<std::size_t>(block.nodes[10 * e + 9])] =
                          std::numeric_limits<double>::quiet_NaN();
                    });
}

TEST(SharedFaults, ReportTheFirstElementThatHasANodeTwice) {
  expect_same_fault(
      Filling::Tetrahedra, "twice; write the mesh without degenerate elements",
      [](HighOrderMesh&, ElementBlock& block, std::size_t e) { block.nodes[10 * e + 8] = block.nodes[10 * e + 2]; });
}

TEST(SharedFaults, ReportTheFirstIndexThatIsNoNode) {
  expect_same_fault(Filling::Triangles, "refers to node index", [](HighOrderMesh&, ElementBlock& block, std::size_t e) {
    block.nodes[6 * e + 5] = std::int32_t(1) << 30;
  });
}

TEST(SharedFaults, ReportTheFirstTwins) {
  expect_same_fault(Filling::Tetrahedra, "are the same tetrahedron",
                    [](HighOrderMesh&, ElementBlock& block, std::size_t e) {
                      std::copy_n(block.nodes.begin() + static_cast<std::ptrdiff_t>(10 * (e / 2)), 10,
                                  block.nodes.begin() + static_cast<std::ptrdiff_t>(10 * e));
                    });
}

TEST(SharedFaults, ReportTheFirstNeighboursThatDisagree) {
  expect_same_fault(Filling::Tetrahedra, "disagree on the",
                    [](HighOrderMesh& mesh, ElementBlock& block, std::size_t e) {
                      block.nodes[10 * e + 5] = static_cast<std::int32_t>(mesh.node_count());
                      mesh.coordinates.insert(mesh.coordinates.end(), {0.5, 0.5, 0.5});
                      mesh.node_numbers.push_back(mesh.node_numbers.back() + 1);
                    });
}

TEST(SharedFaults, GiveTheSameBox) {
  const HighOrderMesh mesh = mesh_of(Filling::Tetrahedra, 4);
  HighOrderMesh with_centre = mesh;  // a node that no cell uses
  with_centre.coordinates.insert(with_centre.coordinates.end(), {100, 100, 100});
  for (const int threads : {1, 2, 3, 8}) {
    const Team team(threads);
    BoundingBox box;
    team.run([&] { box = bounding_box(with_centre, team); });
    for (std::size_t k = 0; k < 3; ++k) {
      double low = mesh.coordinates[k], high = low;
      for (std::size_t i = k; i < mesh.coordinates.size(); i += 3) {
        low = std::min(low, mesh.coordinates[i]);
        high = std::max(high, mesh.coordinates[i]);
      }
      EXPECT_EQ(box.low[k], low);
      EXPECT_EQ(box.high[k], high);
    }
  }
}

}  // namespace
}  // namespace varimesh
