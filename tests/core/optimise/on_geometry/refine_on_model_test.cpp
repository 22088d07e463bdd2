// What is said about refining and about cusps of the model, and when the search for cusps ends.
#include "core/optimise/on_geometry/refine_on_model.h"

#include <gtest/gtest.h>

#include "core/curve/curve.h"
#include "tests/core/support/wedge.h"

namespace varimesh {
namespace {

HighOrderMesh tetrahedra(int count) {
  HighOrderMesh mesh;
  mesh.dimension = 3;
  ElementBlock cells;
  cells.shape = Shape::Tetrahedron;
  for (int cell = 1; cell <= count; ++cell) cells.numbers.push_back(cell);
  mesh.blocks.push_back(cells);
  return mesh;
}

TEST(RefiningSentence, CountsInTheSingularAndInThePlural) {
  Refinement done;
  done.edges = 1;
  Result best;
  best.mesh = tetrahedra(5);
  EXPECT_EQ(refining_sentence(done, tetrahedra(4), best, 0, nullptr),
            "Refining split 1 edge of the model; the mesh has 1 more element than the 4 with which it came.");
  done.swapped = 2;
  EXPECT_EQ(
      refining_sentence(done, tetrahedra(7), best, 0, nullptr),
      "Refining split 1 edge and swapped 2 edges of the model; the mesh has 2 fewer elements than the 7 with which it "
      "came.");
}

TEST(MostDistanceInRounds, IsTwiceTheLargestAndNeverZero) {
  SlideReport slid;
  EXPECT_GT(most_distance_in_rounds(slid), 0);
  EXPECT_LT(most_distance_in_rounds(slid), 1e-300);
  slid.before.largest = 1;
  slid.after.largest = 3;
  EXPECT_EQ(most_distance_in_rounds(slid), 6);
}

/// A mesh of one element at a cusp, which is not certified valid.
Result at_a_cusp(const geometry::Geometry& model) {
  const Team team(1);
  Result best;
  team.run([&] {
    auto association = associate(testing::in_wedge(model), model, team);
    ASSERT_TRUE(association) << association.error().sentence;
    auto curved = curve(testing::in_wedge(model), std::move(*association), 3, team);
    ASSERT_TRUE(curved) << curved.error().sentence;
    best.mesh = std::move(curved->mesh);
  });
  for (const std::int32_t node :
       best.mesh.blocks[1].nodes) {  // edges at the border of the surfaces have stayed straight
    Eigen::Map<Eigen::Vector2d> x(&best.mesh.coordinates[3 * static_cast<std::size_t>(node)]);
    x = Eigen::Vector2d(0, 1) + (x - Eigen::Vector2d(0, 1)).normalized();
  }
  best.after.uncertified.emplace_back().number = 7;
  return best;
}

TEST(CuspsSentence, IsLeftOutIfTheSearchIsStopped) {
  const geometry::Geometry model = testing::wedge(0);
  const Result best = at_a_cusp(model);
  EXPECT_NE(cusps_sentence(best, &model, 1, 0, {}).find("surfaces 1 and 2 'Hole' meet at 0.0°"), std::string::npos);
  EXPECT_EQ(cusps_sentence(best, &model, 1, 0, [] { return true; }), "");
  EXPECT_EQ(cusps_sentence(best, nullptr, 1, 0, {}), "");
}

TEST(CuspsSentence, IsThereIfTheRunHasUsedUpItsTime) {
  const geometry::Geometry model = testing::wedge(0);
  EXPECT_NE(cusps_sentence(at_a_cusp(model), &model, 1, 1e-9, {}), "");
}

}  // namespace
}  // namespace varimesh
