#include "tests/bench/structured/structured_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/mesh/check.h"
#include "core/mesh/connectivity.h"
#include "core/quality/quality.h"
#include "core/validity/certificate.h"
#include "core/validity/orientation.h"
#include "tests/core/support/print.h"

namespace varimesh::bench {
namespace {

StructuredMesh wanted(Shape shape, int order, std::int64_t elements) {
  StructuredMesh wanted;
  wanted.shape = shape;
  wanted.order = order;
  wanted.elements = elements;
  return wanted;
}

TEST(CubeWithHole, ConformsAndIsClosedForEveryShapeAndOrder) {
  for (const Shape shape : {Shape::Tetrahedron, Shape::Hexahedron})
    for (int order = 1; order <= 6; ++order) {
      SCOPED_TRACE(order);
      const auto mesh = cube_with_hole(wanted(shape, order, shape == Shape::Hexahedron ? 200 : 1200));
      ASSERT_TRUE(mesh) << mesh.error().sentence;
      const auto checked = check_structure(*mesh);
      ASSERT_TRUE(checked) << checked.error().sentence;
      EXPECT_EQ(detail::orientation(*mesh), 1);
      // Every facet with one neighbour is an element of the boundary, and there are no others.
      const Facets all = facets(*mesh);
      std::size_t outer = 0;
      for (const std::int32_t neighbour : all.neighbour) outer += neighbour < 0 ? 1 : 0;
      EXPECT_EQ(outer, mesh->element_count(2));
      EXPECT_EQ(outer, all.elements.size());
      EXPECT_EQ(all.crowded_count, 0u);
    }
}

TEST(CubeWithHole, HasNodesOnTheSphereAndOnTheCube) {
  for (const Shape shape : {Shape::Tetrahedron, Shape::Hexahedron}) {
    const auto mesh = cube_with_hole(wanted(shape, 4, 1000));
    ASSERT_TRUE(mesh);
    ASSERT_EQ(mesh->blocks.size(), 3u);
    for (const std::int32_t node : mesh->blocks[1].nodes) {
      const double* at = mesh->coordinates.data() + 3 * node;
      EXPECT_NEAR(std::hypot(at[0], at[1], at[2]), 0.5, 1e-15);
    }
    for (const std::int32_t node : mesh->blocks[2].nodes) {
      const double* at = mesh->coordinates.data() + 3 * node;
      EXPECT_NEAR(std::max({std::abs(at[0]), std::abs(at[1]), std::abs(at[2])}), 1, 1e-15);
    }
  }
}

TEST(CubeWithHole, IsValidFromTheStart) {
  for (const Shape shape : {Shape::Tetrahedron, Shape::Hexahedron})
    for (const int order : {2, 4}) {
      const auto mesh = cube_with_hole(wanted(shape, order, 5000));
      ASSERT_TRUE(mesh);
      EXPECT_EQ(summarise(certify(*mesh)).valid, std::int64_t(mesh->element_count(3)));
    }
}

TEST(CubeWithHole, HasNoNearlyFlatHexahedra) {
  const auto mesh = cube_with_hole(wanted(Shape::Hexahedron, 1, 100'000));
  ASSERT_TRUE(mesh);
  EXPECT_GT(quality(*mesh).min_scaled_jacobian, 0.15);
}

TEST(CubeWithHole, ComesCloseToTheWantedNumberAndShape) {
  for (const std::int64_t elements : {30'000, 120'000, 480'000, 1'000'000})
    for (const int cells_each : {1, 6}) {
      const BlockCounts counts = block_counts(elements, cells_each);
      const double made = 6.0 * cells_each * counts.along * counts.along * counts.radial;
      EXPECT_NEAR(made / static_cast<double>(elements), 1, 0.05);
      EXPECT_NEAR(double(counts.radial) / counts.along, 2.0 / 3, 0.07);
    }
}

TEST(CubeWithHole, ShiftsInnerNodesIfAsked) {
  StructuredMesh shaken = wanted(Shape::Tetrahedron, 3, 1000);
  const auto still = cube_with_hole(shaken);
  shaken.node_shift = 0.05;
  const auto moved = cube_with_hole(shaken);
  ASSERT_TRUE(still && moved);
  EXPECT_TRUE(check_structure(*moved));
  const std::vector<bool> fixed = fixed_nodes(*still);
  std::size_t changed = 0;
  for (std::size_t i = 0; i < fixed.size(); ++i) {
    const bool same = std::equal(still->coordinates.begin() + std::ptrdiff_t(3 * i),
                                 still->coordinates.begin() + std::ptrdiff_t(3 * i + 3),
                                 moved->coordinates.begin() + std::ptrdiff_t(3 * i));
    EXPECT_TRUE(same || !fixed[i]);
    changed += same ? 0 : 1;
  }
  EXPECT_GT(changed, fixed.size() / 2);
}

TEST(CubeWithHole, RefusesWhatItCannotMake) {
  EXPECT_FALSE(cube_with_hole(wanted(Shape::Prism, 2, 1000)));
  EXPECT_FALSE(cube_with_hole(wanted(Shape::Tetrahedron, 0, 1000)));
  EXPECT_FALSE(cube_with_hole(wanted(Shape::Tetrahedron, 11, 1000)));
  EXPECT_FALSE(cube_with_hole(wanted(Shape::Hexahedron, 3, 5)));
  EXPECT_FALSE(cube_with_hole(wanted(Shape::Hexahedron, 10, 100'000'000)));
}

TEST(PerturbedSquare, IsAcceptedAndHasShiftedVertices) {
  const auto mesh = perturbed_square(9);
  ASSERT_TRUE(mesh);
  EXPECT_TRUE(check_structure(*mesh));
  EXPECT_EQ(mesh->element_count(2), 81u);
  const std::vector<bool> fixed = fixed_nodes(*mesh);
  EXPECT_EQ(std::count(fixed.begin(), fixed.end(), false), 64);
  EXPECT_NE(mesh->coordinates[3 * 11], 1.0 / 9);
}

}  // namespace
}  // namespace varimesh::bench
