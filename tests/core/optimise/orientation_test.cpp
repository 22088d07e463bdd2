// Elements that are numbered clockwise, all or some, make no difference to an optimisation.
#include <gtest/gtest.h>

#include "core/optimise/optimiser.h"
#include "tests/core/support/balls.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/turned.h"

namespace varimesh {
namespace {

using testing::Filling;

/// Whether two runs took the same path to the same mesh, bit for bit.
void expect_same_run(const Result& one, const Result& other, const std::string& what) {
  EXPECT_EQ(one.mesh.coordinates, other.mesh.coordinates) << what;
  ASSERT_EQ(one.history.size(), other.history.size()) << what;
  for (std::size_t i = 0; i < one.history.size(); ++i)
    EXPECT_EQ(one.history[i].energy, other.history[i].energy) << what;
  EXPECT_EQ(one.before.min_scaled_jacobian, other.before.min_scaled_jacobian) << what;
  EXPECT_EQ(one.after.min_scaled_jacobian, other.after.min_scaled_jacobian) << what;
  EXPECT_EQ(one.after.certified.min_scaled_jacobian_lower_bound, other.after.certified.min_scaled_jacobian_lower_bound);
  EXPECT_EQ(one.after.uncertified.size(), other.after.uncertified.size()) << what;
}

Result run(const HighOrderMesh& mesh, Options options) {
  options.threads = 1;
  auto result = optimise(mesh, options);
  EXPECT_TRUE(result) << result.error().sentence;
  return result ? std::move(*result) : Result{};
}

class ClockwiseMesh : public ::testing::TestWithParam<std::tuple<Filling, int>> {};

TEST_P(ClockwiseMesh, GivesTheSameBitsAsTheCounterClockwiseOne) {
  const auto [filling, order] = GetParam();
  HighOrderMesh mesh = testing::grid(filling, {3, 2, 2}, order, testing::bent(testing::is_plane(filling) ? 2 : 3));
  testing::shake(mesh, 0.12, 7, testing::Shaken::AllInterior);  // some cells are inverted
  Options options;
  options.max_iterations = 5;
  const Result usual = run(mesh, options);
  EXPECT_TRUE(usual.before.clockwise.empty());
  const std::size_t notes = usual.notes.size();  // a linear mesh may have nothing to move
  for (const auto& chosen : {testing::every_cell, testing::every_third_cell}) {
    const HighOrderMesh mirrored = testing::turned(mesh, chosen);
    const auto numbers = detail::cell_numbers(mesh, testing::cells_that(mesh, chosen));
    options.orient = false;
    const Result kept = run(mirrored, options);
    expect_same_run(usual, kept, "kept");
    EXPECT_EQ(testing::nodes_of_blocks(kept.mesh), testing::nodes_of_blocks(mirrored));
    EXPECT_EQ(kept.before.clockwise, numbers);
    EXPECT_EQ(kept.after.clockwise, numbers);
    ASSERT_EQ(kept.notes.size(), notes + 1);
    EXPECT_NE(kept.notes.back().find("written as they came"), std::string::npos) << kept.notes.back();
    options.orient = true;
    const Result turned = run(mirrored, options);
    expect_same_run(usual, turned, "turned");
    EXPECT_EQ(testing::nodes_of_blocks(turned.mesh), testing::nodes_of_blocks(mesh));
    EXPECT_EQ(turned.before.clockwise, numbers);
    EXPECT_TRUE(turned.after.clockwise.empty());
    ASSERT_EQ(turned.notes.size(), notes + 1);
    EXPECT_NE(turned.notes.back().find("written counter-clockwise"), std::string::npos) << turned.notes.back();
  }
}

INSTANTIATE_TEST_SUITE_P(EveryFilling, ClockwiseMesh,
                         ::testing::Combine(::testing::ValuesIn(testing::kFillings), ::testing::Values(1, 2, 3, 4)),
                         [](const auto& info) {
                           return std::string(testing::name(std::get<0>(info.param))) +
                                  std::to_string(std::get<1>(info.param));
                         });

TEST(ClockwiseElements, MayChangeTheirOrder) {
  Options options;
  options.order = 3;
  options.max_iterations = 3;
  for (const Filling filling : {Filling::MixedPlane, Filling::MixedSolid}) {
    const HighOrderMesh mesh = testing::grid(filling, {4, 2, 2}, 1, testing::bent(2));
    const Result usual = run(mesh, options);
    const Result kept = run(testing::turned(mesh, testing::every_third_cell), options);
    expect_same_run(usual, kept, testing::name(filling));
    EXPECT_EQ(testing::nodes_of_blocks(kept.mesh),
              testing::nodes_of_blocks(testing::turned(usual.mesh, testing::every_third_cell)));
  }
}

TEST(ClockwiseElements, HaveClockwisePartsIfTheyAreSplit) {
  Options options;
  options.repair = Repair::Split;
  options.max_iterations = 60;
  const HighOrderMesh mesh = testing::six_in_a_ball(3);
  const Result usual = run(mesh, options);
  ASSERT_GT(usual.mesh.element_count(3), mesh.element_count(3));
  const Result all = run(testing::turned(mesh, testing::every_cell), options);
  expect_same_run(usual, all, "all");
  EXPECT_EQ(testing::nodes_of_blocks(all.mesh),
            testing::nodes_of_blocks(testing::turned(usual.mesh, testing::every_cell)));
  const Result some = run(testing::turned(mesh, testing::every_third_cell), options);
  expect_same_run(usual, some, "some");
  // Each part lies in the tetrahedron that its number says; the clockwise ones are those of the clockwise parents.
  EXPECT_GT(some.after.clockwise.size(), some.before.clockwise.size());
  EXPECT_LT(some.after.clockwise.size(), some.mesh.element_count(3));
  const std::vector<char> clockwise = detail::clockwise_cells(some.mesh, facets(some.mesh));
  EXPECT_EQ(detail::cell_numbers(some.mesh, clockwise), some.after.clockwise);
  HighOrderMesh back = some.mesh;
  detail::turn_cells(back, clockwise);
  EXPECT_EQ(testing::nodes_of_blocks(back), testing::nodes_of_blocks(usual.mesh));
  options.orient = true;
  const Result turned = run(testing::turned(mesh, testing::every_third_cell), options);
  EXPECT_EQ(testing::nodes_of_blocks(turned.mesh), testing::nodes_of_blocks(usual.mesh));
}

TEST(ClockwiseElements, AreStraightenedLikeAnyOther) {
  Options options;
  options.repair = Repair::Straighten;
  const HighOrderMesh mesh = testing::two_in_a_ball(2);
  const Result usual = run(mesh, options);
  expect_same_run(usual, run(testing::turned(mesh, testing::every_cell), options), "all");
}

TEST(ClockwiseElements, AreOfOneSetUpForManyCoordinates) {
  HighOrderMesh mesh = testing::grid(Filling::Triangles, {3, 3, 1}, 2, testing::bent(2));
  auto usual = Optimiser::create(mesh);
  auto kept = Optimiser::create(testing::turned(mesh, testing::every_third_cell));
  ASSERT_TRUE(usual && kept);
  for (const unsigned seed : {1U, 2U}) {
    testing::shake(mesh, 0.02, seed);
    const auto one = usual->run(mesh.coordinates), other = kept->run(mesh.coordinates);
    ASSERT_TRUE(one && other);
    expect_same_run(*one, *other, "seed " + std::to_string(seed));
    EXPECT_EQ(testing::nodes_of_blocks(other->mesh),
              testing::nodes_of_blocks(testing::turned(mesh, testing::every_third_cell)));
  }
}

}  // namespace
}  // namespace varimesh
