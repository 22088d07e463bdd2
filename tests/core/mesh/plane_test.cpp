// A plane mesh in space is put into its plane, and comes back.
#include "core/mesh/plane.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/mesh/check.h"
#include "core/mesh/checked_mesh.h"
#include "core/optimise/optimiser.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::Place;

/// A curved plate with shaken nodes, in the plane that a map puts it into.
HighOrderMesh plate(const std::function<Place(Place)>& into_space) {
  HighOrderMesh mesh = testing::grid(Filling::MixedPlane, {3, 3, 0}, 3, testing::bent(2));
  testing::shake(mesh, 0.03, 1);
  testing::move_nodes(mesh, into_space);
  return mesh;
}

Place same(Place at) { return at; }
Place upright(Place at) { return {at[0], 0.25, at[1]}; }  // (x, y) becomes (x, z)
Place tilted(Place at) {
  // The columns of a rotation.
  return {0.6 * at[0] - 0.64 * at[1] + 5, 0.8 * at[0] + 0.48 * at[1], 0.6 * at[1] - 7};
}

std::optional<Plane> plane_of(const HighOrderMesh& mesh) { return Plane::of(mesh, Team(1)); }

TEST(PlaneOfAMesh, IsFoundInAnyDirection) {
  EXPECT_FALSE(plane_of(plate(same))) << "z is constant";
  EXPECT_FALSE(plane_of(testing::grid(Filling::Hexahedra, {1, 1, 1}, 1)));
  ASSERT_TRUE(plane_of(plate(upright)));
  EXPECT_EQ(std::abs(plane_of(plate(upright))->normal()[1]), 1);
  ASSERT_TRUE(plane_of(plate(tilted)));
  EXPECT_NEAR(plane_of(plate(tilted))->normal()[2], 0.8, 1e-12);
  EXPECT_FALSE(plane_of(plate([](Place at) { return Place{at[0], at[0] * at[0], at[1]}; }))) << "it bends";
}

TEST(PlaneOfAMesh, MayHaveNoise) {
  int node = 0;
  const auto noise = [&](double amount) { return (node++ % 2 == 0 ? amount : -amount); };
  EXPECT_FALSE(is_surface(plate([&](Place at) { return Place{at[0], at[1], noise(1e-7)}; })));
  EXPECT_TRUE(plane_of(plate([&](Place at) { return Place{at[0], noise(1e-7), at[1]}; })));
  EXPECT_FALSE(plane_of(plate([&](Place at) { return Place{at[0], noise(1e-4), at[1]}; })));
}

TEST(PlaneOfAMesh, PutsNodesBackBitForBit) {
  for (const auto& map : {upright, tilted}) {
    const HighOrderMesh came = plate(map);
    HighOrderMesh mesh = came;
    auto plane = plane_of(mesh);
    ASSERT_TRUE(plane);
    plane->flatten(mesh);
    EXPECT_FALSE(is_surface(mesh));
    EXPECT_TRUE(check_structure(mesh));
    HighOrderMesh back = mesh;
    plane->put_back(back);
    EXPECT_EQ(back.coordinates, came.coordinates);
    mesh.coordinates[0] += 0.5;
    plane->put_back(mesh);
    double moved = 0;
    for (std::size_t k = 0; k < 3; ++k) moved += std::pow(mesh.coordinates[k] - came.coordinates[k], 2);
    EXPECT_NEAR(std::sqrt(moved), 0.5, 1e-14);
    EXPECT_TRUE(std::equal(came.coordinates.begin() + 3, came.coordinates.end(), mesh.coordinates.begin() + 3));
  }
}

TEST(PlaneOfAMesh, IsWhereItIsOptimised) {
  Options options;
  options.max_iterations = 20;
  const auto flat = optimise(plate(same), options), up = optimise(plate(upright), options),
             tilt = optimise(plate(tilted), options);
  ASSERT_TRUE(flat && up && tilt) << (up ? "" : up.error().sentence);
  ASSERT_GT(flat->iterations, 0);
  // (x, y) became (x, z), of which the normal is −y: the cells are numbered as before, and nothing else differs.
  for (std::size_t node = 0; node < flat->mesh.node_count(); ++node) {
    EXPECT_EQ(up->mesh.coordinates[3 * node], flat->mesh.coordinates[3 * node]);
    EXPECT_EQ(up->mesh.coordinates[3 * node + 1], 0.25);
    EXPECT_EQ(up->mesh.coordinates[3 * node + 2], flat->mesh.coordinates[3 * node + 1]);
    // In a tilted plane everything is rounded otherwise. Its nodes stay in the plane 0.48 x − 0.36 y + 0.8 z = −3.2.
    const double* x = tilt->mesh.coordinates.data() + 3 * node;
    EXPECT_NEAR(0.48 * x[0] - 0.36 * x[1] + 0.8 * x[2], -3.2, 1e-13);
  }
  EXPECT_EQ(tilt->after.uncertified.size(), flat->after.uncertified.size());
  EXPECT_NEAR(tilt->after.mean_scaled_jacobian, flat->after.mean_scaled_jacobian, 1e-3);
  ASSERT_FALSE(up->notes.empty());
  EXPECT_NE(up->notes.back().find("lies in a plane with the normal"), std::string::npos);
}

}  // namespace
}  // namespace varimesh
