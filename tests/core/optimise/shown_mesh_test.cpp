// Runs that show their mesh while they go on (RunControl::show_mesh).
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/optimise/optimiser.h"
#include "core/quality/quality.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/for_energy.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::read_case;

/// What a run has shown.
struct Shown {
  std::vector<HighOrderMesh> meshes;
  RunControl control;

  Shown() {
    control.mesh_wanted = [] { return true; };
    control.show_mesh = [this](const MeshOnTheWay& shown) {
      const std::vector<Certificate> certificates = certify(shown.mesh);
      ASSERT_EQ(shown.certificates.size(), certificates.size());
      for (std::size_t cell = 0; cell < certificates.size(); ++cell)
        EXPECT_EQ(shown.certificates[cell].answer, certificates[cell].answer) << cell;
      const std::vector<double> expected = cell_quality(shown.mesh).scaled_jacobian;
      EXPECT_EQ(std::vector<double>(shown.scaled_jacobians.begin(), shown.scaled_jacobians.end()), expected);
      meshes.push_back(shown.mesh);
    };
  }
  Shown(const Shown&) = delete;
};

TEST(ShownMesh, MovesAndChangesNothing) {
  for (const Options& options : {testing::for_energy(), Options()})
    for (const char* const name : {"nine_triangles.msh", "annulus_p3.msh", "cylinder_p2.msh"}) {
      SCOPED_TRACE(name);
      const HighOrderMesh mesh = read_case(name);
      Shown shown;
      const auto quiet = optimise(mesh, options), watched = optimise(mesh, options, {}, shown.control);
      ASSERT_TRUE(quiet && watched);
      EXPECT_EQ(quiet->mesh.coordinates, watched->mesh.coordinates);
      EXPECT_EQ(quiet->iterations, watched->iterations);
      ASSERT_GT(shown.meshes.size(), 1U);
      EXPECT_LE(shown.meshes.size(), static_cast<std::size_t>(watched->iterations));
      EXPECT_NE(shown.meshes.front().coordinates, mesh.coordinates);
      EXPECT_NE(shown.meshes.front().coordinates, shown.meshes.back().coordinates);
      EXPECT_EQ(shown.meshes.front().blocks.size(), mesh.blocks.size());
    }
}

TEST(ShownMesh, IsNotMadeForNobody) {
  Shown shown;
  shown.control.mesh_wanted = [] { return false; };
  ASSERT_TRUE(optimise(read_case("nine_triangles.msh"), testing::for_energy(), {}, shown.control));
  EXPECT_TRUE(shown.meshes.empty());
}

TEST(ShownMesh, LiesInThePlaneOfTheMesh) {
  HighOrderMesh mesh = read_case("nine_triangles.msh");
  testing::move_nodes(mesh, [](testing::Place p) { return testing::Place{p[0], 0.6 * p[1], 0.8 * p[1] + 3}; });
  std::vector<HighOrderMesh> meshes;
  RunControl control;
  control.mesh_wanted = [] { return true; };
  control.show_mesh = [&](const MeshOnTheWay& shown) { meshes.push_back(shown.mesh); };
  ASSERT_TRUE(optimise(mesh, testing::for_energy(), {}, control));
  ASSERT_FALSE(meshes.empty());
  for (const HighOrderMesh& shown : meshes)
    for (std::size_t node = 0; node < shown.node_count(); ++node)
      EXPECT_NEAR(shown.coordinates[3 * node + 2], 3 + shown.coordinates[3 * node + 1] * 0.8 / 0.6, 1e-9);
}

}  // namespace
}  // namespace varimesh
