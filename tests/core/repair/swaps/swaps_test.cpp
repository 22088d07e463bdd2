// Swaps and collapses: the new cells fill the room of the old ones, and the mesh stays one; what must stay does; and a
// run with the repair topology makes meshes valid that movement and splits leave.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <set>

#include "core/base/index.h"
#include "core/mesh/check.h"
#include "core/mesh/conformity.h"
#include "core/optimise/optimiser.h"
#include "core/repair/swaps/cell_patch.h"
#include "core/repair/swaps/changes_around.h"
#include "core/repair/swaps/swap_passes.h"
#include "core/validity/certificate.h"
#include "core/validity/orientation.h"
#include "tests/core/support/balls.h"

namespace varimesh {
namespace {

/// The mesh with all its cells in its first block.
HighOrderMesh in_one_block(HighOrderMesh mesh) {
  ElementBlock& first = mesh.blocks[0];
  for (std::size_t b = 1; b < mesh.blocks.size(); ++b) {
    first.numbers.insert(first.numbers.end(), mesh.blocks[b].numbers.begin(), mesh.blocks[b].numbers.end());
    first.nodes.insert(first.nodes.end(), mesh.blocks[b].nodes.begin(), mesh.blocks[b].nodes.end());
  }
  mesh.blocks.resize(1);
  return mesh;
}

/// A regular polygon of triangles around a vertex in its middle, at (shift, 0), of any order, with sides on the unit
/// circle.
HighOrderMesh fan(int sides, double shift, int order) {
  HighOrderMesh mesh;
  mesh.dimension = 2;
  mesh.order = 1;
  mesh.coordinates = {shift, 0, 0};
  for (int k = 0; k < sides; ++k) {
    const double angle = 2 * M_PI * k / sides;
    mesh.coordinates.insert(mesh.coordinates.end(), {std::cos(angle), std::sin(angle), 0});
  }
  mesh.node_numbers.resize(mesh.node_count());
  std::iota(mesh.node_numbers.begin(), mesh.node_numbers.end(), 1);
  mesh.node_blocks = {{2, 1, 0, static_cast<std::int32_t>(mesh.node_count())}};
  ElementBlock& block = mesh.blocks.emplace_back();
  block.shape = Shape::Triangle;
  block.entity = 1;
  for (int k = 0; k < sides; ++k) {
    block.numbers.push_back(100 + k);
    block.nodes.insert(block.nodes.end(), {0, 1 + k, 1 + (k + 1) % sides});
  }
  HighOrderMesh curved = *change_order(mesh, order);
  testing::round_off(curved);
  return curved;
}

/// A disc of eight triangles. One of them has two sides on the circle, so that it has no room between them.
HighOrderMesh disc_with_an_ear(int order) {
  HighOrderMesh mesh = fan(9, 0.1, 1);
  std::vector<std::int32_t>& nodes = mesh.blocks[0].nodes;
  nodes.resize(3 * 7);  // the fan without its last two triangles
  nodes.insert(nodes.end(), {0, 8, 1, 8, 9, 1});
  HighOrderMesh curved = *change_order(mesh, order);
  testing::round_off(curved);
  return curved;
}

CellPatch whole_patch(const HighOrderMesh& mesh) {
  const Cells cells(mesh, mesh.dimension);
  std::vector<std::int32_t> all(cells.count());
  std::iota(all.begin(), all.end(), 0);
  const std::vector<bool> fixed = fixed_nodes(mesh);
  return take_patch(mesh, cells, all, fixed, SplitRules(mesh, cells, fixed));
}

double straight_volume(const HighOrderMesh& mesh) {
  const HighOrderMesh straight = *change_order(mesh, 1);
  return testing::volume(straight);
}

/// Checks that the mesh is a whole one with the boundary of the other, node for node.
void expect_same_outside(const HighOrderMesh& before, const HighOrderMesh& after) {
  const auto checked = check_structure(after);
  ASSERT_TRUE(checked) << checked.error().sentence;
  const Facets found = facets(after);
  EXPECT_LT(found.crowded, 0);
  EXPECT_TRUE(check_conformity(after, found, Team(1)));
  EXPECT_EQ(std::ranges::count(found.neighbour, -1), std::ranges::count(facets(before).neighbour, -1));
  std::map<std::int64_t, std::array<double, 3>> places[2];
  for (const HighOrderMesh* mesh : {&before, &after}) {
    const std::vector<bool> fixed = fixed_nodes(*mesh);
    for (std::size_t n = 0; n < mesh->node_count(); ++n)
      if (fixed[n])
        places[mesh == &after][mesh->node_numbers[n]] = {mesh->coordinates[3 * n], mesh->coordinates[3 * n + 1],
                                                         mesh->coordinates[3 * n + 2]};
  }
  EXPECT_EQ(places[0], places[1]);
  std::vector<bool> used(after.node_count(), false);
  for (const ElementBlock& block : after.blocks)
    for (const std::int32_t node : block.nodes) used[at(node)] = true;
  EXPECT_EQ(std::ranges::count(used, false), 0) << "nodes without an element";
  std::set<std::int64_t> numbers;
  for (const ElementBlock& block : after.blocks) numbers.insert(block.numbers.begin(), block.numbers.end());
  EXPECT_EQ(numbers.size(), after.element_count(after.dimension));
}

class SwapCells : public ::testing::TestWithParam<int> {};

TEST_P(SwapCells, TurnsAFaceIntoAnEdgeBetweenThree) {
  const HighOrderMesh two = in_one_block(testing::two_in_a_ball(GetParam()));
  const CellPatch patch = whole_patch(two);
  const std::vector<CellChange> changes = changes_around(patch, 0);
  ASSERT_EQ(changes.size(), 1u);  // all edges and vertices are on the boundary
  EXPECT_EQ(changes[0].place.size(), 3u);
  EXPECT_EQ(changes[0].added.size(), 3u);
  HighOrderMesh three = two;
  std::vector<RepairStep> steps;
  const CellPatch after = changed(patch, changes[0]);
  put_back(three, std::span(&after, 1), steps);
  EXPECT_EQ(three.element_count(3), 3u);
  expect_same_outside(two, three);
  EXPECT_NEAR(straight_volume(three) / straight_volume(two), 1, 1e-12);
  ASSERT_EQ(steps.size(), 1u);
  EXPECT_EQ(steps[0].kind, RepairStep::Kind::Swapped);
  EXPECT_EQ(steps[0].sentence,
            "The face between nodes 10, 11 and 12 was swapped: tetrahedra 100 and 101 became tetrahedra 102, 103 and "
            "104.");
}

TEST_P(SwapCells, RemovesAnEdgeByEveryTriangulationOfItsRing) {
  const HighOrderMesh six = in_one_block(testing::six_in_a_ball(GetParam()));
  const CellPatch patch = whole_patch(six);
  std::size_t triangulations = 0;
  for (const CellChange& change : changes_around(patch, 0)) {
    triangulations += change.removed.size() == 6 ? 1 : 0;
    HighOrderMesh other = six;
    std::vector<RepairStep> steps;
    const CellPatch after = changed(patch, change);
    put_back(other, std::span(&after, 1), steps);
    expect_same_outside(six, other);
    EXPECT_NEAR(straight_volume(other) / straight_volume(six), 1, 1e-12);
    EXPECT_EQ(other.element_count(3), 6 - change.removed.size() + change.added.size());
  }
  EXPECT_EQ(triangulations, 14u);  // of a hexagon
}

TEST_P(SwapCells, CollapsesAnInteriorVertexOntoEachNeighbour) {
  const HighOrderMesh five = fan(5, 0.1, GetParam());
  const CellPatch patch = whole_patch(five);
  std::size_t collapses = 0;
  for (const CellChange& change : changes_around(patch, 0)) {
    HighOrderMesh other = five;
    std::vector<RepairStep> steps;
    const CellPatch after = changed(patch, change);
    put_back(other, std::span(&after, 1), steps);
    expect_same_outside(five, other);
    if (change.kind != RepairStep::Kind::Collapsed) continue;
    ++collapses;
    EXPECT_EQ(other.element_count(2), 3u);
    EXPECT_EQ(steps[0].kind, RepairStep::Kind::Collapsed);
    EXPECT_LT(other.node_count(), five.node_count());
  }
  EXPECT_EQ(collapses, 5u);
}

TEST_P(SwapCells, LeavesWhatIsFixedOrBetweenTwoGroups) {
  const HighOrderMesh two = testing::two_in_a_ball(GetParam());  // of two blocks
  EXPECT_TRUE(changes_around(whole_patch(two), 0).empty());
  HighOrderMesh with_interface = in_one_block(two);
  const Cells cells(with_interface, 3);
  ElementBlock face;
  face.shape = Shape::Triangle;
  face.order = GetParam();
  face.entity = 7;
  face.numbers = {900};
  for (std::size_t f = 0; f < 4; ++f) {
    const std::vector<int>& local = reference::facet_nodes(Shape::Tetrahedron, GetParam(), static_cast<int>(f));
    std::set<std::int32_t> corners;
    for (std::size_t k = 0; k < 3; ++k) corners.insert(cells.nodes(0)[at(local[k])]);
    if (corners.contains(3)) continue;
    for (const int n : local) face.nodes.push_back(cells.nodes(0)[at(n)]);
  }
  with_interface.blocks.push_back(face);
  EXPECT_TRUE(changes_around(whole_patch(with_interface), 0).empty());
}

INSTANTIATE_TEST_SUITE_P(Orders, SwapCells, ::testing::Values(1, 2, 3, 4, 5),
                         [](const auto& info) { return "Order" + std::to_string(info.param); });

class Topology : public ::testing::TestWithParam<int> {};

TEST_P(Topology, GivesATriangleWithTwoSidesOnACircleRoom) {
  const HighOrderMesh disc = disc_with_an_ear(GetParam());
  Options options;
  options.repair = Repair::Split;  // it knows tetrahedra only
  const Expected<Result> split = optimise(disc, options);
  ASSERT_TRUE(split) << split.error().sentence;
  EXPECT_LT(split->after.min_scaled_jacobian, options.min_js);  // from order 3 on, below 0
  options.repair = Repair::Topology;
  const Expected<Result> swapped = optimise(disc, options);
  ASSERT_TRUE(swapped) << swapped.error().sentence;
  EXPECT_EQ(swapped->after.certified.valid, 9);
  EXPECT_GT(swapped->after.min_scaled_jacobian, options.min_js);
  EXPECT_TRUE(are_valid(certify(swapped->mesh)));
  expect_same_outside(disc, swapped->mesh);
  ASSERT_EQ(swapped->repairs.size(), 1u);
  EXPECT_EQ(swapped->repairs[0].sentence,
            "The edge between nodes 2 and 9 was swapped: triangles 107 and 108 became triangles 109 and 110.");
  EXPECT_TRUE(swapped->unrepairable.empty());
}

TEST_P(Topology, DoesNotDependOnTheNumberOfThreads) {
  const HighOrderMesh disc = disc_with_an_ear(GetParam());
  Options options;
  options.repair = Repair::Topology;
  options.threads = 1;
  const Expected<Result> one = optimise(disc, options);
  options.threads = 3;
  const Expected<Result> three = optimise(disc, options);
  ASSERT_TRUE(one && three);
  EXPECT_EQ(one->mesh.coordinates, three->mesh.coordinates);
  EXPECT_EQ(one->mesh.blocks[0].nodes, three->mesh.blocks[0].nodes);
}

TEST_P(Topology, LeavesAWholeMeshWheneverItIsStopped) {
  const HighOrderMesh disc = disc_with_an_ear(GetParam());
  Options options;
  options.threads = 1;
  std::size_t stopped = 0, ended = 0;
  for (int looks = 0; looks < 100'000 && ended == 0; looks += 1 + looks / 20) {
    int left = looks;
    const StopToken stop([&] { return --left < 0; });
    std::vector<RepairStep> steps;
    const HighOrderMesh after = swap_in_passes(disc, {options, 0.1, {}, {}, {}}, steps, stop);
    expect_same_outside(disc, after);
    ++(stop.reason() == StopToken::Reason::None ? ended : stopped);
  }
  EXPECT_GT(stopped, 3u);
  EXPECT_EQ(ended, 1u);
}

TEST_P(Topology, LeavesAValidMeshAboveTheBoundAsItIs) {
  const HighOrderMesh disc = fan(9, 0.1, GetParam());
  Options options;
  options.repair = Repair::Topology;
  const Expected<Result> done = optimise(disc, options);
  ASSERT_TRUE(done) << done.error().sentence;
  EXPECT_TRUE(done->repairs.empty());
  EXPECT_EQ(done->mesh.blocks[0].nodes, disc.blocks[0].nodes);
}

INSTANTIATE_TEST_SUITE_P(Orders, Topology, ::testing::Values(2, 3, 4),
                         [](const auto& info) { return "Order" + std::to_string(info.param); });

}  // namespace
}  // namespace varimesh
