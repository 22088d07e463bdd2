// Converged means converged: every free node is within the tolerance of the optimum, in units of the size of the
// elements around it, whatever else is in the mesh. The optimum is a run to a tolerance of 1e-12.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <ostream>
#include <string>
#include <vector>

#include "core/formats/formats.h"
#include "core/mesh/connectivity.h"
#include "core/optimise/optimiser.h"
#include "core/problem/sizes.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::Place;

constexpr double kExact = 1e-12;

/// By node of the mesh: the smallest size of a cell with this node, in the mesh's unit; +∞ if there is none.
std::vector<double> node_sizes(const HighOrderMesh& mesh) {
  const Problem problem = testing::make_problem(mesh);
  std::vector<double> sizes(mesh.node_count(), std::numeric_limits<double>::infinity());
  for (const CellSet& set : problem.sets)
    for (std::size_t n = 0; n < set.nodes.size(); ++n) {
      double& size = sizes[std::size_t(set.nodes[n])];
      const std::size_t cell = std::size_t(set.first) + n / std::size_t(set.nodes_per_cell);
      size = std::min(size, double(problem.cell_size[cell]) * frame_of(mesh).diagonal);
    }
  return sizes;
}

/// The longest distance between the positions of a node in two meshes, in units of its size in `input`. `one` may have
/// more nodes at its end.
double furthest(const HighOrderMesh& input, const HighOrderMesh& one, const HighOrderMesh& other) {
  const std::vector<double> sizes = node_sizes(input);
  double most = 0;
  for (std::size_t n = 0; n < input.node_count(); ++n) {
    const double *a = &one.coordinates[3 * n], *b = &other.coordinates[3 * n];
    most = std::max(most, std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]) / sizes[n]);
  }
  return most;
}

Options with_lambda(double lambda) {
  Options options;
  options.constants = Constants::Reference;
  options.lambda = lambda;
  return options;
}

/// Where the linear systems are too hard to prove anything, or a certificate would be lost at the optimum, the run has
/// to say so. Then there is nothing to compare.
void expect_within_tolerance(const HighOrderMesh& mesh, Options options, bool may_end_sooner = false) {
  const auto result = optimise(mesh, options);
  ASSERT_TRUE(result) << result.error().sentence;
  EXPECT_EQ(result->converged, result->stop_reason == StopReason::Converged);
  if (may_end_sooner && !result->converged) return;
  ASSERT_TRUE(result->converged);
  EXPECT_LE(result->residual, options.tolerance);
  const double tolerance = options.tolerance;
  options.tolerance = kExact;
  const auto exact = optimise(mesh, options);
  ASSERT_TRUE(exact);
  // Rounding may keep the last step above 1e-12, but not far.
  EXPECT_LE(exact->residual, 1e-10);
  EXPECT_LE(furthest(mesh, result->mesh, exact->mesh), tolerance);
}

// ===== the meshes in tests/cases and made ones =====

struct Made {
  std::string name;
  HighOrderMesh (*make)();
};

void PrintTo(const Made& made, std::ostream* out) { *out << made.name; }

/// Triangles and squares that become thinner by the factor 30 towards a curved wall.
HighOrderMesh layers(Filling filling) {
  HighOrderMesh mesh = testing::grid(filling, {6, 6, 0}, 4, [](Place p) {
    return Place{p[0], (std::pow(1000, p[1]) - 1) / 999, 0};
  });
  testing::move_nodes(mesh, [](Place p) {
    const double bump = 0.02 * std::sin(3.14159265358979323846 * p[0]);
    return p[1] < 1e-9 ? Place{p[0], bump, 0} : Place{p[0], p[1] + bump * (1 - p[1]), 0};
  });
  testing::shake(mesh, 2e-4, 5);
  return mesh;
}

const Made kMade[] = {
    {"circle_p5", [] { return testing::read_case("circle_p5.msh"); }},
    {"aerofoil_p4", [] { return testing::read_case("aerofoil_p4.msh"); }},
    {"annulus_p3", [] { return testing::read_case("annulus_p3.msh"); }},
    {"sphere_p3", [] { return testing::read_case("sphere_p3.msh"); }},
    {"thin_triangles", [] { return layers(Filling::Triangles); }},
    {"thin_mixed", [] { return layers(Filling::MixedPlane); }},
};

class Converged : public ::testing::TestWithParam<std::tuple<Made, int>> {};

TEST_P(Converged, MeansWithinTheToleranceOfTheOptimum) {
  const auto& [made, lambda] = GetParam();
  expect_within_tolerance(made.make(), with_lambda(lambda));
}

INSTANTIATE_TEST_SUITE_P(Small, Converged,
                         ::testing::Combine(::testing::ValuesIn(kMade), ::testing::Values(1, 10, 640)),
                         [](const auto& info) {
                           return std::get<0>(info.param).name + "_lambda" + std::to_string(std::get<1>(info.param));
                         });

// ===== the shared cases =====

class ConvergedOnSharedCases : public ::testing::TestWithParam<std::string> {};

TEST_P(ConvergedOnSharedCases, MeansWithinTheToleranceOfTheOptimum) {
  if (std::getenv("VARIMESH_LONG_TESTS") == nullptr) GTEST_SKIP() << "NOT RUN: long; set VARIMESH_LONG_TESTS=1";
  const char* folder = std::getenv("VARIMESH_CASES");
  const std::filesystem::path path = std::filesystem::path(folder ? folder : VARIMESH_SOURCE_DIR "/../shared/cases") /
                                     "meshes" / (GetParam() + ".msh");
  if (!std::filesystem::exists(path))
    GTEST_SKIP() << "NOT RUN: the shared cases are not at " << path << "; set VARIMESH_CASES to their folder.";
  const auto file = formats::read_file(path.string());
  ASSERT_TRUE(file) << file.error().sentence;
  for (const double lambda : {1.0, 10.0, 160.0, 640.0}) {
    SCOPED_TRACE("lambda " + std::to_string(lambda));
    expect_within_tolerance(file->mesh, with_lambda(lambda), lambda > 10);
  }
}

INSTANTIATE_TEST_SUITE_P(Shared, ConvergedOnSharedCases,
                         ::testing::Values("annquad_p4", "circ500_p5", "circ500m_p5", "cylprism_p2", "naca524_p5",
                                           "nacabl_p4", "reference_naca524_p3", "reference_sphere276_p4", "sph276_p5",
                                           "sphbl_p2", "sphhex_p3"),
                         [](const auto& info) { return info.param; });

// ===== what is far away =====

TEST(FarAway, NodesThatNoElementUsesChangeNothing) {
  for (const Method method : {Method::Auto, Method::Sweeps}) {
    Options options;
    options.method = method;
    options.max_iterations = 20;
    HighOrderMesh mesh = testing::read_case("circle_p5.msh");
    const auto without = optimise(mesh, options);
    mesh.coordinates.insert(mesh.coordinates.end(), {1e5, -1e5, 0});
    mesh.node_numbers.push_back(1000000);
    ++mesh.node_blocks.back().count;
    const auto with = optimise(mesh, options);
    ASSERT_TRUE(without && with) << (with ? "" : with.error().sentence);
    EXPECT_EQ(with->iterations, without->iterations);
    for (std::size_t i = 0; i < without->mesh.coordinates.size(); ++i)
      ASSERT_EQ(with->mesh.coordinates[i], without->mesh.coordinates[i]);
  }
}

/// Both meshes as one, without a common node.
HighOrderMesh joined(HighOrderMesh one, const HighOrderMesh& other) {
  const auto nodes = static_cast<std::int32_t>(one.node_count());
  const auto elements = static_cast<std::int64_t>(one.element_count(0) + one.element_count(1) + one.element_count(2));
  one.coordinates.insert(one.coordinates.end(), other.coordinates.begin(), other.coordinates.end());
  for (const std::int64_t number : other.node_numbers) one.node_numbers.push_back(nodes + number);
  one.node_blocks = {{-1, 0, 0, std::int32_t(one.node_count())}};
  for (ElementBlock block : other.blocks) {
    for (std::int32_t& node : block.nodes) node += nodes;
    for (std::int64_t& number : block.numbers) number += elements;
    one.blocks.push_back(block);
  }
  return one;
}

TEST(FarAway, AMeshThatIsTenThousandTimesAsLargeChangesNothing) {
  HighOrderMesh near = layers(Filling::Triangles);
  HighOrderMesh far = testing::grid(Filling::Quadrilaterals, {12, 4, 0}, 4);
  testing::shake(far, 0.01, 3);
  // Nearly a ring around the first mesh, from 100 to 10,000 of its lengths away.
  testing::move_nodes(far, [](Place p) {
    const double radius = std::pow(100, 1 + p[1]), angle = 6 * p[0];
    return Place{radius * std::cos(angle), -radius * std::sin(angle), 0};
  });
  Options options = with_lambda(10);
  options.tolerance = 1e-10;
  const auto without = optimise(near, options), with = optimise(joined(near, far), options);
  ASSERT_TRUE(without && with) << (with ? "" : with.error().sentence);
  EXPECT_TRUE(without->converged);
  EXPECT_TRUE(with->converged);
  EXPECT_LE(furthest(near, with->mesh, without->mesh), 1e-9);
}

// ===== what is not reached =====

TEST(NotConverged, ALambdaThatThePreconditionerDoesNotFitIsReported) {
  Options options = with_lambda(1e7);
  const auto result = optimise(testing::read_case("circle_p5.msh"), options);
  ASSERT_TRUE(result) << result.error().sentence;
  EXPECT_FALSE(result->converged);
  EXPECT_EQ(result->stop_reason, StopReason::MostProducts);
  EXPECT_GE(std::ranges::count(result->history, LinearSolve::MostProducts, &Iteration::linear_solve), 10);
  for (const Iteration& iteration : result->history)
    EXPECT_EQ(iteration.linear_solve == LinearSolve::None, iteration.phase != Phase::Newton);
}

TEST(NotConverged, AToleranceBelowRoundingEndsTheRun) {
  Options options = with_lambda(1);
  options.tolerance = 1e-15;
  const auto result = optimise(testing::read_case("circle_p5.msh"), options);
  ASSERT_TRUE(result) << result.error().sentence;
  EXPECT_FALSE(result->converged);
  EXPECT_EQ(result->stop_reason, StopReason::NoProgress);
  EXPECT_LT(result->iterations, 100);
  EXPECT_LT(result->residual, 1e-10);
}

}  // namespace
}  // namespace varimesh
