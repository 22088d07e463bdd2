// Whole runs: what optimise() promises to its users.
#include "core/optimise/optimiser.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/mesh/connectivity.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/curved_strip.h"
#include "tests/core/support/for_energy.h"
#include "tests/core/support/made_cells.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::read_case;

/// The mesh rotated by this angle.
HighOrderMesh turned(HighOrderMesh mesh, double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  testing::move_nodes(mesh, [&](testing::Place p) {
    testing::Place q{c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]};
    if (mesh.dimension == 3) q = {q[0], c * q[1] - s * q[2], s * q[1] + c * q[2]};
    return q;
  });
  return mesh;
}

HighOrderMesh curved(Filling filling, int order) {
  HighOrderMesh mesh = testing::grid(filling, {3, 3, 2}, order, testing::bent(testing::is_plane(filling) ? 2 : 3));
  testing::shake(mesh, 0.01, 3);
  return mesh;
}

class OptimiseWithEnergy : public ::testing::TestWithParam<Energy> {
 protected:
  Options options() const {
    Options options = testing::for_energy();
    options.energy = GetParam();
    return options;
  }
};

TEST_P(OptimiseWithEnergy, UntanglesTheNineTriangles) {
  for (const Method method : {Method::Auto, Method::Sweeps}) {
    Options chosen = options();
    chosen.method = method;
    const auto result = optimise(read_case("nine_triangles.msh"), chosen);
    ASSERT_TRUE(result) << result.error().sentence;
    EXPECT_EQ(result->before.invalid_elements, 2);
    EXPECT_EQ(result->after.invalid_elements, 0);
    EXPECT_GT(result->after.min_scaled_jacobian, 0);
    EXPECT_TRUE(result->converged);
  }
}

TEST_P(OptimiseWithEnergy, LeavesFixedNodesBitForBit) {
  const HighOrderMesh mesh = read_case("sphere_p3.msh");
  const std::vector<bool> fixed = fixed_nodes(mesh);
  Options few = options();
  few.max_iterations = 4;
  const auto result = optimise(mesh, few);
  ASSERT_TRUE(result) << result.error().sentence;
  std::size_t moved = 0;
  for (std::size_t n = 0; n < mesh.node_count(); ++n) {
    const bool same = std::memcmp(&mesh.coordinates[3 * n], &result->mesh.coordinates[3 * n], 3 * sizeof(double)) == 0;
    EXPECT_TRUE(same || !fixed[n]) << "node " << mesh.node_numbers[n];
    moved += same ? 0 : 1;
  }
  EXPECT_GT(moved, result->sizes.free_nodes / 2);
}

TEST_P(OptimiseWithEnergy, TurnsWithTheMesh) {
  Options five = options();
  five.method = Method::Sweeps;
  five.max_iterations = 5;
  for (const Filling filling : {Filling::Triangles, Filling::MixedSolid}) {
    const HighOrderMesh mesh = curved(filling, 3);
    const auto straight = optimise(mesh, five), rotated = optimise(turned(mesh, 0.7), five);
    ASSERT_TRUE(straight && rotated);
    EXPECT_LE(testing::distance(turned(straight->mesh, 0.7), rotated->mesh), 1e-9);
  }
}

TEST_P(OptimiseWithEnergy, TakesTheSamePathInAnyUnit) {
  const HighOrderMesh metres = read_case("nine_triangles.msh");
  HighOrderMesh millimetres = metres;
  for (double& x : millimetres.coordinates) x *= 1000;
  const auto a = optimise(metres, options()), b = optimise(millimetres, options());
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->iterations, b->iterations);
  // Sweeps are in double precision throughout, so only rounding differs.
  Options five = options();
  five.method = Method::Sweeps;
  five.max_iterations = 5;
  const HighOrderMesh small = curved(Filling::MixedPlane, 3);
  HighOrderMesh large = small;
  for (double& x : large.coordinates) x *= 1000;
  const auto c = optimise(small, five), d = optimise(large, five);
  ASSERT_TRUE(c && d);
  for (std::size_t i = 0; i < c->mesh.coordinates.size(); ++i)
    EXPECT_NEAR(1000 * c->mesh.coordinates[i], d->mesh.coordinates[i], 1e-6);
}

TEST_P(OptimiseWithEnergy, GivesTheSameBitsOnAnyNumberOfThreads) {
  for (const Method method : {Method::Sweeps, Method::Newton}) {
    Options one = options(), three = options();
    one.method = three.method = method;
    one.max_iterations = three.max_iterations = 6;
    one.threads = 1;
    three.threads = 3;
    const HighOrderMesh mesh = curved(Filling::MixedSolid, 3);
    const auto a = optimise(mesh, one), b = optimise(mesh, three);
    ASSERT_TRUE(a && b);
    EXPECT_EQ(a->mesh.coordinates, b->mesh.coordinates);
    EXPECT_EQ(a->residual, b->residual);
  }
}

TEST_P(OptimiseWithEnergy, NewtonAndSweepsEndAtTheSameMesh) {
  Options newton = options(), sweeps = options();
  newton.method = Method::Newton;
  sweeps.method = Method::Sweeps;
  newton.tolerance = sweeps.tolerance = 1e-9;
  sweeps.max_iterations = 5000;
  const HighOrderMesh mesh = curved(Filling::Triangles, 3);
  const auto a = optimise(mesh, newton), b = optimise(mesh, sweeps);
  ASSERT_TRUE(a && b);
  ASSERT_TRUE(a->converged && b->converged);
  EXPECT_LE(testing::distance(a->mesh, b->mesh), 1e-6);
  EXPECT_LT(a->iterations, 15);
}

std::string name_of(const ::testing::TestParamInfo<Energy>& info) {
  constexpr const char* kNames[] = {"Hyperelastic", "LinearElastic", "Winslow", "Distortion"};
  return kNames[static_cast<int>(info.param)];
}

INSTANTIATE_TEST_SUITE_P(Energies, OptimiseWithEnergy,
                         ::testing::Values(Energy::Hyperelastic, Energy::LinearElastic, Energy::Winslow,
                                           Energy::Distortion),
                         name_of);

TEST(Optimise, WinslowAndDistortionAreTheSameSweepIn2D) {
  HighOrderMesh mesh = curved(Filling::MixedPlane, 4);
  Options options;
  options.method = Method::Sweeps;
  options.max_iterations = 5;
  options.energy = Energy::Winslow;
  const auto a = optimise(mesh, options);
  options.energy = Energy::Distortion;
  const auto b = optimise(mesh, options);
  ASSERT_TRUE(a && b);
  EXPECT_LE(testing::distance(a->mesh, b->mesh), 1e-10);
}

TEST(Optimise, TheRegularisationByPatchUntanglesToo) {
  Options options;
  options.regularisation = Regularisation::Patch;
  options.method = Method::Sweeps;
  options.colouring = Colouring::Node;
  const auto result = optimise(read_case("nine_triangles.msh"), options);
  ASSERT_TRUE(result) << result.error().sentence;
  EXPECT_EQ(result->after.invalid_elements, 0);
}

TEST(Optimise, AClockwiseMeshIsItsMirrorImage) {
  HighOrderMesh mesh = curved(Filling::Triangles, 3), mirrored = mesh;
  testing::move_nodes(mirrored, [](testing::Place p) { return testing::Place{-p[0], p[1], p[2]}; });
  Options options;
  options.tolerance = 1e-11;  // the paths differ, but not the optimum
  const auto a = optimise(mesh, options), b = optimise(mirrored, options);
  ASSERT_TRUE(a && b) << (b ? "" : b.error().sentence);
  HighOrderMesh back = b->mesh;
  testing::move_nodes(back, [](testing::Place p) { return testing::Place{-p[0], p[1], p[2]}; });
  EXPECT_LE(testing::distance(a->mesh, back), 1e-9);
}

TEST(Optimise, NoIterationsChangeNothing) {
  Options options;
  options.max_iterations = 0;
  const HighOrderMesh mesh = read_case("nine_triangles.msh");
  const auto result = optimise(mesh, options);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->mesh.coordinates, mesh.coordinates);
  EXPECT_EQ(result->after.invalid_elements, 2);
  EXPECT_EQ(result->iterations, 0);
}

TEST(Optimise, StopsWhenTold) {
  int calls = 0;
  const auto result = optimise(read_case("nine_triangles.msh"), testing::for_energy(), [&](const Iteration& iteration) {
    EXPECT_EQ(iteration.number, ++calls);
    return calls == 2 ? Control::Stop : Control::Continue;
  });
  ASSERT_TRUE(result);
  EXPECT_TRUE(result->stopped);
  EXPECT_EQ(result->iterations, 2);
  EXPECT_EQ(result->history.size(), 2U);
}

TEST(Optimise, SweepsNeverRaiseTheEnergyOfAValidMesh) {
  Options options;
  options.method = Method::Sweeps;
  options.max_iterations = 30;
  const auto result = optimise(curved(Filling::Tetrahedra, 3), options);
  ASSERT_TRUE(result);
  for (std::size_t i = 1; i < result->history.size(); ++i)
    EXPECT_LE(result->history[i].energy, result->history[i - 1].energy * (1 + 1e-12));
}

TEST(Optimise, ThePNormHasOneOptimumWithEveryMethod) {
  const HighOrderMesh mesh = read_case("nine_triangles.msh");
  Options options;
  options.tolerance = 1e-8;
  HighOrderMesh last = mesh;
  for (const double p : {1.0, 2.0, 4.0}) {
    options.p_norm = p;
    options.method = Method::Auto;
    const auto newton = optimise(mesh, options);
    ASSERT_TRUE(newton) << newton.error().sentence;
    EXPECT_TRUE(newton->converged) << p;
    EXPECT_LE(newton->iterations, 40) << "quadratic convergence needs the rank-one part of the Hessian";
    EXPECT_GT(testing::distance(newton->mesh, last), 1e-3) << "another p should give another mesh";
    last = newton->mesh;
    options.method = Method::Sweeps;
    options.max_iterations = 5000;
    const auto sweeps = optimise(mesh, options);
    ASSERT_TRUE(sweeps && sweeps->converged);
    EXPECT_LE(testing::distance(newton->mesh, sweeps->mesh), 1e-5);
  }
}

// To the 7th power, the energies of most cells vanish in single precision beside those of the worst cells.
TEST(Optimise, ConvergesWithAPNormThatHardlySeesMostCells) {
  for (const auto& [name, least] : {std::pair{"aerofoil_p4.msh", 0.86}, {"circle_p5.msh", 0.77}}) {
    Options options;
    options.p_norm = 8;
    const auto result = optimise(read_case(name), options);
    ASSERT_TRUE(result) << result.error().sentence;
    EXPECT_TRUE(result->converged) << name;
    EXPECT_GT(result->after.min_scaled_jacobian, least) << name;
  }
}

TEST(Optimise, NumbersBeyondSinglePrecisionAreNoConvergence) {
  const HighOrderMesh mesh = read_case("nine_triangles.msh");
  for (const auto& [p, mu] : {std::pair{8.0, 0.0}, {16.0, 0.0}, {1.0, 1e40}}) {
    Options options;
    options.p_norm = p;
    options.mu = mu;
    options.lambda = mu;
    options.method = Method::Newton;
    const auto result = optimise(mesh, options);
    ASSERT_TRUE(result);
    EXPECT_TRUE(!result->converged || result->after.invalid_elements == 0) << "p " << p << ", mu " << mu;
  }
}

TEST(Optimise, RefusesOptionsWithASentence) {
  const HighOrderMesh mesh = read_case("nine_triangles.msh");
  Options options;
  options.quadrature_degree = 2 * (mesh.order - 1) - 1;
  auto result = optimise(mesh, options);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().kind, Error::Kind::BadOption);
  EXPECT_NE(result.error().sentence.find("quadrature_degree"), std::string::npos);
  options = {};
  options.mu = -1;
  result = optimise(mesh, options);
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().sentence.find("mu"), std::string::npos);
}

TEST(Optimise, TakesMeshesThatAreValidOnlyByTheirCurvature) {
  HighOrderMesh mesh = testing::curved_strip(1.1, 4);
  testing::shake(mesh, 0.03, 3);
  const auto result = optimise(mesh, testing::for_energy());
  ASSERT_TRUE(result) << result.error().sentence;
  EXPECT_LT(result->before.min_scaled_jacobian, 0.05);
  EXPECT_EQ(result->after.certified.valid, result->sizes.elements);
  EXPECT_GT(result->after.min_scaled_jacobian, 0.5);
  EXPECT_EQ(result->substitute_targets.elements, (std::vector<std::int64_t>{2, 4}));
  EXPECT_NE(result->substitute_targets.sentence.find("elements 2 and 4 are inverted"), std::string::npos)
      << result->substitute_targets.sentence;
}

TEST(Optimise, NamesNoSubstitutesIfThereAreNone) {
  const auto result = optimise(testing::curved_strip(1.3, 3));
  ASSERT_TRUE(result);
  EXPECT_TRUE(result->substitute_targets.elements.empty());
  EXPECT_EQ(result->substitute_targets.sentence, "");
}

TEST(Optimise, TakesACellThatEnclosesNothingAndRefusesAMeshWithoutSize) {
  HighOrderMesh mesh = testing::one_cell(Shape::Tetrahedron, 2, [](testing::Place p) {
    return testing::Place{p[0], p[1], 0.3 * p[0] - 0.7 * p[1]};
  });
  const auto flat = optimise(mesh);
  ASSERT_TRUE(flat) << flat.error().sentence;
  EXPECT_EQ(flat->mesh.coordinates, mesh.coordinates);
  EXPECT_EQ(flat->after.certified.valid, 0);
  std::fill(mesh.coordinates.begin(), mesh.coordinates.end(), 1.5);
  const auto point = optimise(mesh);
  ASSERT_FALSE(point);
  EXPECT_NE(point.error().sentence.find("has no size"), std::string::npos) << point.error().sentence;
}

TEST(Optimise, GivesATargetToAStraightSidedCellThatIsInvertedOnlyInside) {
  HighOrderMesh mesh = testing::one_cell(Shape::Hexahedron, 1, [](testing::Place p) { return p; });
  // J is at least 0.38 at the corners, and −0.38 inside.
  mesh.coordinates = {-1.7, 0.2,  -0.5, 0.3, -2.3, -1.2, 1.9, 0.8, -0.5, -0.2, 1.4, -0.8,
                      0.1,  -1.9, 1.3,  1.2, 0.2,  -0.1, 0.5, 0.5, 1.9,  -2.0, 2.2, 0.0};
  Options options;
  options.order = 2;  // so that it has a free node
  const auto result = optimise(mesh, options);
  ASSERT_TRUE(result) << result.error().sentence;
  EXPECT_EQ(result->substitute_targets.elements, (std::vector<std::int64_t>{1}));
}

TEST(Optimise, MovesNothingIfThereIsNothingToMove) {
  const auto expect_unmoved = [](const HighOrderMesh& mesh, const Options& options, const std::string& why) {
    const auto result = optimise(mesh, options);
    ASSERT_TRUE(result) << result.error().sentence;
    EXPECT_EQ(result->mesh.coordinates, mesh.coordinates) << why;
    EXPECT_TRUE(result->converged) << why;
    ASSERT_EQ(result->notes.size(), 1U) << why;
    EXPECT_NE(result->notes[0].find(why), std::string::npos) << result->notes[0];
    EXPECT_EQ(result->after.min_scaled_jacobian, result->before.min_scaled_jacobian);
  };
  const Options options = testing::for_energy();
  for (const Filling filling : testing::kFillings)
    for (const int order : {1, 3}) expect_unmoved(testing::grid(filling, {3, 3, 3}, order), options, "straight sides");
  expect_unmoved(testing::one_cell(Shape::Prism, 1, [](testing::Place p) { return p; }), options, "No node is free");
  // One free node, the middle of a square that is bent at its bottom: its optimum is found once.
  HighOrderMesh bent = testing::one_cell(Shape::Quadrilateral, 2, [](testing::Place p) {
    return testing::Place{p[0], p[1] - 0.2 * (1 - p[0] * p[0]) * (1 - p[1]) / 2, 0};
  });
  bent.coordinates[3 * 8] += 0.3;  // away from the optimum, so that the optimum is better than the start
  const auto best = optimise(bent, options);
  ASSERT_TRUE(best);
  EXPECT_TRUE(best->notes.empty());
  EXPECT_NE(best->mesh.coordinates, bent.coordinates);
  expect_unmoved(best->mesh, options, "at its optimum already");
}

TEST(Optimise, SuggestsNoMovementIfNoNodeIsFree) {
  const HighOrderMesh tangled = testing::one_cell(Shape::Triangle, 2, [](testing::Place p) {
    return testing::Place{p[0], p[1] + 2.5 * (1 - p[0] * p[0]) * std::pow((1 - p[1]) / 2, 2),
                          0};  // the bottom is bent over the other sides
  });
  const auto result = optimise(tangled);
  ASSERT_TRUE(result) << result.error().sentence;
  ASSERT_EQ(result->left.uncertified, 1);
  for (const Remedy& remedy : result->left.remedies) EXPECT_NE(remedy.kind, Remedy::Kind::Optimise) << remedy.reason;
}

TEST(Optimiser, RunsAgainOnNewCoordinates) {
  const HighOrderMesh mesh = read_case("nine_triangles.msh");
  auto optimiser = Optimiser::create(mesh);
  ASSERT_TRUE(optimiser) << optimiser.error().sentence;
  const auto first = optimiser->run(mesh.coordinates), again = optimiser->run(mesh.coordinates);
  ASSERT_TRUE(first && again);
  EXPECT_EQ(first->mesh.coordinates, again->mesh.coordinates);
  EXPECT_FALSE(optimiser->run({1, 2, 3}));
  std::vector<double> broken = mesh.coordinates;
  broken[0] = std::nan("");
  EXPECT_FALSE(optimiser->run(broken));
  EXPECT_FALSE(optimiser->run(broken)) << "what was refused once is refused again";
}

}  // namespace
}  // namespace varimesh
