// What the default's result must not depend on: what is far away, a second run, and how the mesh lies in space.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/optimise/optimiser.h"
#include "core/validity/certificate.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::read_case;

HighOrderMesh optimised(const HighOrderMesh& mesh) {
  Options options;
  options.threads = 1;
  const auto result = optimise(mesh, options);
  EXPECT_TRUE(result);
  if (!result) return mesh;
  EXPECT_TRUE(std::ranges::all_of(certify(result->mesh, {}, 1), &Certificate::is_valid));
  return result->mesh;
}

/// Where the node at `place` of `mesh` lies in `moved`.
const double* follow(const HighOrderMesh& mesh, const HighOrderMesh& moved, double x, double y) {
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    if (std::hypot(mesh.coordinates[3 * n] - x, mesh.coordinates[3 * n + 1] - y) < 1e-9)
      return &moved.coordinates[3 * n];
  return nullptr;
}

// An aerofoil in a disc of 440 triangles of order 4, and the same with more triangles round it. The smallest cells have
// the size .02. With a loss weighted by volume nodes differed by .4 of a cell.
TEST(SameResult, NearABodyWhereverTheFarFieldIs) {
  const HighOrderMesh near = read_case("aerofoil_disc_p4.msh"), far = read_case("aerofoil_far_p4.msh");
  const HighOrderMesh near_moved = optimised(near), far_moved = optimised(far);
  double most = 0;
  int compared = 0;
  for (std::size_t n = 0; n < near.node_count(); ++n) {
    const double x = near.coordinates[3 * n], y = near.coordinates[3 * n + 1];
    const double* here = &near_moved.coordinates[3 * n];
    const double* other = follow(far, far_moved, x, y);
    if (other == nullptr || std::hypot(x - 0.5, y) >= 1.6) continue;
    most = std::max(most, std::hypot(here[0] - other[0], here[1] - other[1]));
    ++compared;
  }
  EXPECT_GT(testing::distance(near, near_moved), 1e-3);
  EXPECT_GT(compared, 1000);
  EXPECT_LT(most, 1e-3);
}

TEST(SameResult, OfASecondRun) {
  const HighOrderMesh once = optimised(read_case("aerofoil_far_p4.msh")), again = optimised(once);
  EXPECT_LT(testing::distance(once, again), 2e-4);
}

/// far_vertex.msh with its vertex elsewhere.
HighOrderMesh with_vertex_at(double x, double y) {
  HighOrderMesh mesh = read_case("far_vertex.msh");
  double* vertex = nullptr;
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    if (mesh.coordinates[3 * n] == 100) vertex = &mesh.coordinates[3 * n];
  vertex[0] = x;
  vertex[1] = y;
  return mesh;
}

struct Vertex {
  const char* name;
  double x, y;
};

/// Four tangled cells. They became valid in different ways: by untangling, where weight for low cells then held the
/// descent, where Newton's method went to and fro between two meshes, and in small patches at the end of the run.
class OfASecondRun : public ::testing::TestWithParam<Vertex> {};

TEST_P(OfASecondRun, WhereOneVertexWasFarAway) {
  const HighOrderMesh once = optimised(with_vertex_at(GetParam().x, GetParam().y)), again = optimised(once);
  EXPECT_LT(testing::distance(once, again), 0.01 * 0.5);  // of a cell
}

INSTANTIATE_TEST_SUITE_P(Vertices, OfASecondRun,
                         ::testing::Values(Vertex{"Near", 3, 0.5}, Vertex{"Below", 5, -3}, Vertex{"Far", 95, -3},
                                           Vertex{"Farther", 105, -3}, Vertex{"VeryFar", 300, -3}),
                         [](const auto& info) { return info.param.name; });

/// The same mesh turned and moved far away, with its elements in the reverse order.
HighOrderMesh elsewhere(const HighOrderMesh& mesh, double angle, double shift) {
  HighOrderMesh other = mesh;
  for (ElementBlock& block : other.blocks) {
    const auto nodes = static_cast<std::ptrdiff_t>(block.nodes.size() / block.size());
    for (std::ptrdiff_t a = 0, b = static_cast<std::ptrdiff_t>(block.size()) - 1; a < b; ++a, --b)
      std::swap_ranges(block.nodes.begin() + a * nodes, block.nodes.begin() + (a + 1) * nodes,
                       block.nodes.begin() + b * nodes);
  }
  for (std::size_t n = 0; n < other.node_count(); ++n) {
    const double x = mesh.coordinates[3 * n], y = mesh.coordinates[3 * n + 1];
    other.coordinates[3 * n] = std::cos(angle) * x - std::sin(angle) * y + shift;
    other.coordinates[3 * n + 1] = std::sin(angle) * x + std::cos(angle) * y + shift;
  }
  return other;
}

TEST(SameResult, OfAMeshThatIsTurnedAndMovedAndInAnotherOrder) {
  const HighOrderMesh mesh = read_case("aerofoil_far_p4.msh");
  const HighOrderMesh turned = elsewhere(mesh, 1, 1000);
  const HighOrderMesh result = elsewhere(optimised(mesh), 1, 1000), of_turned = optimised(turned);
  double most = 0;
  for (std::size_t i = 0; i < result.coordinates.size(); ++i)
    most = std::max(most, std::abs(result.coordinates[i] - of_turned.coordinates[i]));
  EXPECT_LT(most, 2e-6);
}

}  // namespace
}  // namespace varimesh
