// Which elements each remedy could help, and what the figures count.
#include "core/diagnosis/remedies.h"

#include <gtest/gtest.h>

#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using Kind = UnrepairableGroup::Kind;

UnrepairableGroup group(Kind kind, std::vector<std::int64_t> elements, double determinant) {
  UnrepairableGroup made;
  made.kind = kind;
  made.elements = std::move(elements);
  made.determinant = determinant;
  return made;
}

class RemediesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const ElementBlock& block : mesh_.blocks)
      if (block.shape == Shape::Tetrahedron) numbers_ = block.numbers;
    ASSERT_GE(numbers_.size(), 6U);
  }

  const HighOrderMesh mesh_ = testing::grid(testing::Filling::Tetrahedra, {2, 1, 1}, 2, testing::bent(3));
  std::vector<std::int64_t> numbers_;
};

TEST_F(RemediesTest, ThereIsNothingToSayAboutAValidMesh) {
  const WhatIsLeft left = what_is_left(mesh_, {}, {}, {});
  EXPECT_EQ(left.uncertified, 0);
  EXPECT_TRUE(left.remedies.empty());
  EXPECT_EQ(left.sentence, "");
}

TEST_F(RemediesTest, NamedElementsThatAreCertifiedDoNotCount) {
  const auto n = numbers_;
  const std::vector<UnrepairableGroup> groups = {group(Kind::Vertex, {n[0]}, -0.2), group(Kind::Vertex, {n[1]}, 1e-9),
                                                 group(Kind::VertexGroup, {n[1], n[2], n[3]}, -0.1)};
  const WhatIsLeft left = what_is_left(mesh_, {n[0], n[1], n[4]}, groups, {});
  EXPECT_EQ(left.uncertified, 3);
  EXPECT_EQ(left.proved, 1);
  EXPECT_EQ(left.unproved, 1);
  EXPECT_EQ(left.sentence,
            "3 elements are not certified valid. It is proved that moving nodes cannot repair 1 of these. Moving nodes "
            "can probably not repair 1 more, but that is not proved.");
}

TEST_F(RemediesTest, SaysInOneSentenceThatAllAreProved) {
  const auto n = numbers_;
  const std::vector<UnrepairableGroup> groups = {group(Kind::Vertex, {n[0]}, -0.2), group(Kind::Vertex, {n[1]}, -0.1)};
  EXPECT_EQ(what_is_left(mesh_, {n[0], n[1]}, groups, {}).sentence,
            "2 elements are not certified valid, and it is proved that moving interior nodes cannot repair them.");
  EXPECT_EQ(what_is_left(mesh_, {n[0]}, groups, {}).sentence,
            "1 element is not certified valid, and it is proved that moving interior nodes cannot repair it.");
}

TEST_F(RemediesTest, SlidingComesBeforeAnotherBoundaryMesh) {
  Tried tried;
  tried.movement = tried.until_valid = tried.split = true;
  const std::vector<UnrepairableGroup> groups = {group(Kind::Vertex, {numbers_[0]}, -0.2)};
  const WhatIsLeft left = what_is_left(mesh_, {numbers_[0]}, groups, tried);
  ASSERT_EQ(left.remedies.size(), 2U);
  EXPECT_EQ(left.remedies[0].kind, Remedy::Kind::Slide);
  EXPECT_EQ(left.remedies[1].kind, Remedy::Kind::OtherBoundary);
  EXPECT_EQ(left.remedies[1].reason,
            "if sliding does not help element " + std::to_string(numbers_[0]) + ", nothing else is known that does.");
}

TEST_F(RemediesTest, EveryUncertifiedElementHasOne) {
  const auto n = numbers_;
  const std::vector<UnrepairableGroup> groups = {group(Kind::Vertex, {n[0]}, -0.2),
                                                 group(Kind::FoldedFace, {n[1]}, -0.2)};
  const std::vector<std::int64_t> uncertified = {n[0], n[1], n[2]};
  using Kind = Remedy::Kind;
  using All = std::vector<std::pair<Kind, std::int64_t>>;
  const auto kinds_and_counts = [&](const Tried& tried) {
    All all;
    for (const Remedy& remedy : what_is_left(mesh_, uncertified, groups, tried).remedies)
      all.emplace_back(remedy.kind, remedy.elements);
    return all;
  };
  const All boundary = {{Kind::Slide, 1}, {Kind::OtherBoundary, 1}};
  const auto then_boundary = [&](All first) {
    first.insert(first.end(), boundary.begin(), boundary.end());
    return first;
  };
  EXPECT_EQ(kinds_and_counts({}), then_boundary({{Kind::Optimise, 1}, {Kind::Split, 1}})) << "not optimised yet";
  Tried tried;
  tried.movement = true;
  EXPECT_EQ(kinds_and_counts(tried), then_boundary({{Kind::UntilValid, 1}, {Kind::Split, 2}}));
  tried.until_valid = true;
  EXPECT_EQ(kinds_and_counts(tried), then_boundary({{Kind::Split, 2}}));
  tried.split = true;
  EXPECT_EQ(kinds_and_counts(tried), (All{{Kind::Slide, 3}, {Kind::OtherBoundary, 3}}))
      << "only another boundary is left";
  tried.cut_short = true;
  EXPECT_EQ(kinds_and_counts(tried), (All{{Kind::MoreTime, 1}, {Kind::Slide, 2}, {Kind::OtherBoundary, 2}}));
}

TEST_F(RemediesTest, TheNextOrderComesFirstIfItHasHelped) {
  Tried tried;
  tried.movement = tried.until_valid = true;
  tried.next_order = 3;
  tried.left_at_next_order = 1;
  const WhatIsLeft left = what_is_left(mesh_, {numbers_[0], numbers_[1]}, {}, tried);
  ASSERT_FALSE(left.remedies.empty());
  const Remedy& first = left.remedies.front();
  EXPECT_EQ(first.kind, Remedy::Kind::RaiseOrder);
  EXPECT_EQ(first.order, 3);
  EXPECT_EQ(first.elements, 1);
  EXPECT_EQ(first.reason, "a run at this order has left only 1 element that is not certified valid.");
}

TEST(Remedies, OnASurfaceInSpaceOnlyAnotherMeshHelps) {
  HighOrderMesh surface = testing::grid(testing::Filling::Triangles, {2, 2, 0}, 2);
  testing::move_nodes(surface, [](testing::Place at) { return testing::Place{at[0], at[1], at[0] * at[1]}; });
  EXPECT_TRUE(diagnose(surface).empty());
  const WhatIsLeft left = what_is_left(surface, {Cells(surface, 2).number(0)}, {}, {});
  ASSERT_EQ(left.remedies.size(), 1U);
  EXPECT_EQ(left.remedies[0].kind, Remedy::Kind::OtherBoundary);
}

}  // namespace
}  // namespace varimesh
