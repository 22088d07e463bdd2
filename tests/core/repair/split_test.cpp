// A split keeps shape, volume, boundary, numbers and groups, and the mesh conforms.
#include "core/repair/split.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "core/base/team.h"
#include "core/formats/formats.h"
#include "core/mesh/check.h"
#include "core/mesh/conformity.h"
#include "tests/core/support/balls.h"

namespace varimesh {
namespace {

constexpr SplitPlace kDiagonal{0, 7, -1};
constexpr SplitPlace kMiddle{0, 1, 2};

HighOrderMesh split_one(const HighOrderMesh& mesh, const SplitPlace& place, std::vector<RepairStep>* steps = nullptr) {
  std::vector<RepairStep> done;
  HighOrderMesh result = split(mesh, std::span(&place, 1), done);
  if (steps != nullptr) *steps = done;
  return result;
}

/// change_order() keeps the vertices' node numbers, and keeps the vertices in front.
class SplitTetrahedra : public ::testing::TestWithParam<int> {
 protected:
  SplitTetrahedra() {
    testing::shake(six_, 0.03);
    testing::shake(two_, 0.03);
  }
  HighOrderMesh six_ = testing::six_in_a_ball(GetParam()), two_ = testing::two_in_a_ball(GetParam());
};

TEST_P(SplitTetrahedra, KeepsTheVolume) {
  for (const auto& [mesh, place] : {std::pair(&six_, kDiagonal), std::pair(&two_, kMiddle)}) {
    const HighOrderMesh parts = split_one(*mesh, place);
    EXPECT_NEAR(testing::volume(parts) / testing::volume(*mesh), 1, 1e-12);
  }
}

TEST_P(SplitTetrahedra, ConformsAndHasTheNumberOfElementsExpected) {
  const HighOrderMesh twelve = split_one(six_, kDiagonal), six = split_one(two_, kMiddle);
  EXPECT_EQ(twelve.element_count(3), 12u);
  EXPECT_EQ(six.element_count(3), 6u);
  for (const HighOrderMesh* mesh : {&twelve, &six}) {
    const Facets found = facets(*mesh);
    EXPECT_LT(found.crowded, 0);
    EXPECT_TRUE(check_conformity(*mesh, found, Team(1)));
    EXPECT_EQ(std::ranges::count(found.neighbour, -1), mesh == &twelve ? 12 : 6);
    const auto checked = check_structure(*mesh);
    EXPECT_TRUE(checked) << checked.error().sentence;
  }
}

TEST_P(SplitTetrahedra, KeepsBoundaryNodesAndNumbers) {
  std::vector<RepairStep> steps;
  const HighOrderMesh parts = split_one(six_, kDiagonal, &steps);
  const std::vector<bool> fixed = fixed_nodes(six_), still = fixed_nodes(parts);
  for (std::size_t n = 0; n < six_.node_count(); ++n) {
    EXPECT_EQ(parts.node_numbers[n], six_.node_numbers[n]);
    EXPECT_EQ(fixed[n], still[n]);
    for (std::size_t c = 0; c < 3 && fixed[n]; ++c)
      EXPECT_EQ(parts.coordinates[3 * n + c], six_.coordinates[3 * n + c]);
  }
  const std::int64_t highest = *std::ranges::max_element(six_.node_numbers);
  for (std::size_t n = six_.node_count(); n < parts.node_count(); ++n) EXPECT_GT(parts.node_numbers[n], highest);
  // No node is left without an element.
  std::vector<bool> used(parts.node_count(), false);
  for (const ElementBlock& block : parts.blocks)
    for (const std::int32_t node : block.nodes) used[static_cast<std::size_t>(node)] = true;
  EXPECT_EQ(std::ranges::count(used, false), 0);

  ASSERT_EQ(steps.size(), 1u);
  EXPECT_EQ(steps[0].kind, RepairStep::Kind::SplitEdge);
  EXPECT_EQ(steps[0].vertices, (std::vector<std::int64_t>{10, 17}));
  EXPECT_GT(steps[0].node, highest);
  EXPECT_EQ(steps[0].elements, (std::vector<std::int64_t>{100, 101, 102, 103, 104, 105}));
  EXPECT_EQ(steps[0].new_elements.size(), 6u);
  EXPECT_NE(steps[0].sentence.find("between nodes 10 and 17"), std::string::npos) << steps[0].sentence;
}

TEST_P(SplitTetrahedra, CarriesEntitiesAndGroupsOver) {
  const HighOrderMesh parts = split_one(six_, kDiagonal);
  ASSERT_EQ(parts.blocks.size(), 2u);
  for (std::size_t b = 0; b < 2; ++b) {
    EXPECT_EQ(parts.blocks[b].entity, six_.blocks[b].entity);
    EXPECT_EQ(parts.blocks[b].physical, six_.blocks[b].physical);
    EXPECT_EQ(parts.blocks[b].size(), 6u);
    EXPECT_TRUE(std::ranges::equal(six_.blocks[b].numbers, std::span(parts.blocks[b].numbers).first(3)));
    for (std::size_t e = 3; e < 6; ++e) EXPECT_GT(parts.blocks[b].numbers[e], 105);
  }
  std::int32_t next = 0;
  for (const NodeBlock& block : parts.node_blocks) {
    EXPECT_EQ(block.first, next);
    next += block.count;
  }
  EXPECT_EQ(next, static_cast<std::int32_t>(parts.node_count()));
}

TEST_P(SplitTetrahedra, SurvivesEveryFormat) {
  // MSH 2.2 repeats elements that are in two groups. A mesh read from it has numbers for the repeats.
  for (const formats::Format format : {formats::Format::Msh22, formats::Format::Msh41Binary}) {
    std::string bytes;
    const Sink sink = [&](std::string_view part) {
      bytes += part;
      return true;
    };
    ASSERT_TRUE(formats::write(six_, format, sink));
    auto before = formats::read(bytes);
    ASSERT_TRUE(before) << before.error().sentence;
    SplitPlace place = kDiagonal;
    for (std::size_t n = 0; n < before->mesh.node_count(); ++n) {
      if (before->mesh.node_numbers[n] == 10) place[0] = static_cast<std::int32_t>(n);
      if (before->mesh.node_numbers[n] == 17) place[1] = static_cast<std::int32_t>(n);
    }
    if (place[0] > place[1]) std::swap(place[0], place[1]);
    const HighOrderMesh parts = split_one(before->mesh, place);
    bytes.clear();
    ASSERT_TRUE(formats::write(parts, format, sink));
    const auto after = formats::read(bytes);
    ASSERT_TRUE(after) << after.error().sentence;
    EXPECT_EQ(after->mesh.node_numbers, parts.node_numbers);
    EXPECT_EQ(after->mesh.coordinates, parts.coordinates);
    EXPECT_EQ(after->mesh.element_count(3), 12u);
    std::map<int, std::size_t> in_group;
    for (const ElementBlock& block : after->mesh.blocks)
      for (const int group : block.physical) in_group[group] += block.size();
    EXPECT_EQ(in_group, (std::map<int, std::size_t>{{1, 6}, {2, 6}, {3, 12}}));
  }
}

INSTANTIATE_TEST_SUITE_P(Orders, SplitTetrahedra, ::testing::Values(2, 3, 4, 5),
                         [](const auto& info) { return "Order" + std::to_string(info.param); });

}  // namespace
}  // namespace varimesh
