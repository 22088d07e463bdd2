// The cells around one free node, as the kernels take them.
#include "core/kernels/node_star.h"

#include <gtest/gtest.h>

#include "tests/core/support/made_cells.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::make_problem;

TEST(NodeStar, PointsAtTheArraysOfItsCells) {
  for (const Filling filling : testing::kFillings) {
    Problem problem =
        make_problem(testing::grid(filling, {2, 2, 2}, 2, testing::bent(testing::is_plane(filling) ? 2 : 3)));
    hold_deformation(problem, true);
    for (std::size_t rank = 0; rank < problem.free.size(); ++rank) {
      NodeStar star(problem, std::int32_t(rank));
      ASSERT_EQ(star.cells().size(), std::size_t(problem.offsets[rank + 1] - problem.offsets[rank]));
      for (std::size_t i = 0; i < star.cells().size(); ++i) {
        const Incidence& at = problem.incidences[std::size_t(problem.offsets[rank]) + i];
        CellSet& set = problem.sets[std::size_t(at.set)];
        const StarCell& cell = star.cells()[i];
        EXPECT_EQ(cell.deformation, set.deformation_of(at.cell));
        EXPECT_EQ(cell.derivatives, set.derivatives_of(at.local));
        EXPECT_EQ(cell.jacobian_function, set.jacobian_function_of(at.cell));
        EXPECT_EQ(cell.weights, set.weights.data());
        EXPECT_EQ(cell.stride, set.stride);
        EXPECT_EQ(cell.line, nullptr);
        if (set.uniform_target_of(at.cell) == nullptr) {
          EXPECT_EQ(cell.inverse_target, set.inverse_target_of(at.cell));
          EXPECT_EQ(cell.measure, set.measure_of(at.cell));
          EXPECT_EQ(cell.affine, set.affine);
        } else {
          EXPECT_EQ(cell.inverse_target, set.uniform_target_of(at.cell));
          EXPECT_TRUE(cell.affine) << "one matrix is enough";
        }
      }
    }
  }
}

TEST(NodeStar, GivesCellsRoomWhileThereIsSome) {
  Problem problem = make_problem(testing::grid(Filling::Tetrahedra, {2, 2, 2}, 2));
  AlignedVector<double> scratch(NodeStar::kMostNumbers);
  const int stride = problem.sets[0].stride, line_size = static_cast<int>(NodeStar::kMostNumbers) / stride / 3;
  for (std::int32_t rank = 0; rank < std::int32_t(problem.free.size()); ++rank) {
    NodeStar star(problem, rank, line_size, scratch.data());
    for (std::size_t i = 0; i < star.cells().size(); ++i) {
      double* const expected = i < 3 ? scratch.data() + i * line_size * stride : nullptr;
      EXPECT_EQ(star.cells()[i].line, expected);
    }
  }
}

TEST(NodeStar, HoldsMoreCellsThanItsArrayOnTheStack) {
  // A fan of 600 triangles around one free node.
  constexpr int kTriangles = 600;
  HighOrderMesh mesh = testing::empty_mesh(Shape::Triangle, 1);
  ElementBlock block;
  block.shape = Shape::Triangle;
  mesh.coordinates = {0, 0, 0};
  for (int i = 0; i < kTriangles; ++i) {
    const double angle = 2 * M_PI * i / kTriangles;
    mesh.coordinates.insert(mesh.coordinates.end(), {std::cos(angle), std::sin(angle), 0});
    block.numbers.push_back(i + 1);
    block.nodes.insert(block.nodes.end(), {0, 1 + i, 1 + (i + 1) % kTriangles});
  }
  for (std::size_t n = 0; n < mesh.node_count(); ++n) mesh.node_numbers.push_back(std::int64_t(n) + 1);
  mesh.blocks.push_back(block);
  Problem problem = make_problem(mesh);
  ASSERT_EQ(problem.free.size(), 1U);
  hold_deformation(problem, false);
  NodeStar star(problem, 0);
  ASSERT_EQ(star.cells().size(), std::size_t(kTriangles));
  for (int i = 0; i < kTriangles; ++i)
    EXPECT_EQ(star.cells()[std::size_t(i)].deformation,
              problem.sets[0].deformation_of(problem.incidences[std::size_t(i)].cell));
}

}  // namespace
}  // namespace varimesh
