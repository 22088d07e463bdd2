// Elements become straight as far as the boundary allows, and no certificate is lost.
#include "core/repair/straighten.h"

#include <gtest/gtest.h>

#include <cstring>
#include <numeric>

#include "tests/core/support/balls.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

struct Straightened {
  HighOrderMesh mesh;
  std::vector<Certificate> before, after;
  std::vector<RepairStep> steps;
};

/// Straightens these cells as one unrepairable group.
Straightened straightened(HighOrderMesh mesh, std::vector<std::int32_t> chosen) {
  Straightened result;
  const Certifier certifier(mesh);
  const Team team(1);
  const std::vector<bool> fixed = fixed_nodes(mesh);
  UnrepairableGroup group;
  group.cells = std::move(chosen);
  const Cells cells(mesh, mesh.dimension);
  for (const std::int32_t cell : group.cells) group.elements.push_back(cells.number(static_cast<std::size_t>(cell)));
  std::vector<Certificate> certificates(certifier.cells());
  HighOrderMesh moved = mesh;
  team.run([&] {
    certifier.certify(mesh.coordinates, certificates, team);
    result.before = certificates;
    result.steps = straighten(moved, fixed, certifier, certificates, std::span(&group, 1), team);
  });
  result.after = certificates;
  result.mesh = std::move(moved);
  return result;
}

double largest_change(const HighOrderMesh& a, const HighOrderMesh& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.coordinates.size(); ++i)
    most = std::max(most, std::abs(a.coordinates[i] - b.coordinates[i]));
  return most;
}

class StraightenShapes : public ::testing::TestWithParam<testing::Filling> {};

TEST_P(StraightenShapes, GivesAStraightSidedMeshBack) {
  // A grid with plane sides, with all inner nodes shaken until cells are invalid. Straightening all cells restores the
  // grid.
  const bool plane = testing::is_plane(GetParam());
  const HighOrderMesh straight = testing::grid(GetParam(), {2, 2, 2}, 4);
  HighOrderMesh shaken = straight;
  const std::vector<bool> fixed = fixed_nodes(straight);
  std::vector<bool> vertex(straight.node_count(), false);
  const Cells cells(straight, straight.dimension);
  for (std::size_t c = 0; c < cells.count(); ++c)
    for (int v = 0; v < reference::info(cells.shape(c)).vertices; ++v)
      vertex[static_cast<std::size_t>(cells.nodes(c)[static_cast<std::size_t>(v)])] = true;
  testing::shake(shaken, 0.2);
  for (std::size_t n = 0; n < straight.node_count(); ++n)
    for (std::size_t c = 0; c < 3; ++c)
      if (vertex[n] || (plane && c == 2)) shaken.coordinates[3 * n + c] = straight.coordinates[3 * n + c];
  std::vector<std::int32_t> all(cells.count());
  std::iota(all.begin(), all.end(), 0);
  const Straightened result = straightened(shaken, all);
  EXPECT_LT(largest_change(result.mesh, straight), 1e-12);
  ASSERT_EQ(result.steps.size(), 1u);
  EXPECT_EQ(result.steps[0].kind, RepairStep::Kind::Straightened);
  for (const Certificate& certificate : result.after) EXPECT_EQ(certificate.answer, Certificate::Answer::Valid);
}

INSTANTIATE_TEST_SUITE_P(Shapes, StraightenShapes,
                         ::testing::Values(testing::Filling::Triangles, testing::Filling::Tetrahedra),
                         [](const auto& info) { return testing::name(info.param); });

TEST(StraightenBall, KeepsTheBoundaryAndEveryCertificate) {
  HighOrderMesh mesh = testing::six_in_a_ball(4);
  testing::shake(mesh, 0.02);
  const Straightened result = straightened(mesh, {0, 1, 2, 3, 4, 5});
  const std::vector<bool> fixed = fixed_nodes(mesh);
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    if (fixed[n]) {
      EXPECT_EQ(std::memcmp(&mesh.coordinates[3 * n], &result.mesh.coordinates[3 * n], 3 * sizeof(double)), 0);
    }
  for (std::size_t c = 0; c < result.before.size(); ++c)
    if (result.before[c].is_valid()) {
      EXPECT_EQ(result.after[c].answer, Certificate::Answer::Valid);
    }
  // The diagonal from (−1, −1, −1)/√3 to (1, 1, 1)/√3 is straight: its nodes divide it equally and have equal
  // components.
  const auto& places = reference::node_places(Shape::Tetrahedron, 4);
  int on_diagonal = 0;
  for (std::size_t n = 0; n < places.size(); ++n) {
    if (places[n].dimension != 1 || places[n].index != 3) continue;
    const double* x = result.mesh.coordinates.data() + 3 * static_cast<std::size_t>(mesh.blocks[0].nodes[n]);
    EXPECT_NEAR(x[0], x[1], 1e-12);
    EXPECT_NEAR(x[0], x[2], 1e-12);
    EXPECT_NEAR(std::remainder(x[0] * std::sqrt(3.0), 0.5), 0, 1e-12);
    ++on_diagonal;
  }
  EXPECT_EQ(on_diagonal, 3);
}

TEST(StraightenTakesBack, KeepsEdgesCurvedIfNeighboursNeedThem) {
  // One side of a square bulges inwards so far that the triangles beside it are valid only with curved inner edges.
  const auto bulge = [](testing::Place x) {
    return testing::Place{x[0], x[1] + 0.45 * std::sin(M_PI * x[0]) * (1 - x[1]), x[2]};
  };
  HighOrderMesh mesh = testing::grid(testing::Filling::Triangles, {2, 2, 1}, 4);
  testing::move_nodes(mesh, bulge);
  const std::size_t last = mesh.element_count(2) - 1;
  // One inner node turns over the last triangle, at the top.
  const Cells cells(mesh, 2);
  const auto inside = static_cast<std::size_t>(cells.nodes(last)[14]);
  mesh.coordinates[3 * inside] -= 0.6;
  const Straightened result = straightened(mesh, {static_cast<std::int32_t>(last)});
  ASSERT_NE(result.before[last].answer, Certificate::Answer::Valid);
  for (std::size_t c = 0; c < result.before.size(); ++c)
    if (result.before[c].is_valid()) {
      EXPECT_EQ(result.after[c].answer, Certificate::Answer::Valid) << c;
    }
  EXPECT_FALSE(result.steps.empty());
}

}  // namespace
}  // namespace varimesh
