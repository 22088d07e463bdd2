// What a run hands out is never worse for having gone on, and never worse than a mesh that came in valid.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <numbers>
#include <string>
#include <tuple>
#include <vector>

#include "core/formats/formats.h"
#include "core/mesh/changes/change_order.h"
#include "core/validity/certificate.h"
#include "tests/core/optimise/stopped_runs.h"
#include "tests/core/support/for_energy.h"
#include "tests/core/support/ring_mesh.h"

namespace varimesh {
namespace {

using testing::pushed;
using testing::read_case;
using testing::RunToStop;

std::int64_t uncertified(const Result& result) { return std::ssize(result.after.uncertified); }

/// Runs on tangled meshes that pass through meshes with lost certificates.
std::vector<RunToStop> tangled_runs() {
  std::vector<RunToStop> runs;
  const auto add = [&](const std::string& name, HighOrderMesh mesh) {
    runs.push_back(testing::run_to_stop(name, std::move(mesh), [](Options&) {}));
  };
  add("triangles", pushed(testing::Filling::Triangles, {6, 6, 1}, 4, 0.2));
  add("quadrilaterals", pushed(testing::Filling::Quadrilaterals, {5, 5, 1}, 3, 0.25));
  add("tetrahedra", pushed(testing::Filling::Tetrahedra, {3, 3, 2}, 3, 0.15));
  return runs;
}

class TangledRun : public ::testing::TestWithParam<RunToStop> {};

TEST_P(TangledRun, IsNeverWorseForHavingGoneOn) {
  Options options = GetParam().options;
  std::int64_t fewest = std::ssize(GetParam().mesh.coordinates);
  bool lost = false;
  for (int iterations = 1; iterations <= 25; ++iterations) {
    options.max_iterations = iterations;
    const auto result = optimise(GetParam().mesh, options);
    ASSERT_TRUE(result) << result.error().sentence;
    ASSERT_LE(uncertified(*result), fewest) << iterations << " iterations";
    fewest = uncertified(*result);
    const Iteration& last = result->history.back();
    EXPECT_EQ(last.left_elements, uncertified(*result)) << "what the progress says";
    EXPECT_EQ(result->left.uncertified, uncertified(*result));
    lost = lost || last.left_elements != last.invalid_elements;
    if (result->iterations < iterations) break;
  }
  EXPECT_TRUE(lost) << "no iteration has lost a certificate";
}

INSTANTIATE_TEST_SUITE_P(Meshes, TangledRun, ::testing::ValuesIn(tangled_runs()),
                         [](const auto& info) { return info.param.name; });

// ===== a run until the mesh is valid is the beginning of the run without this end =====

/// Meshes that are tangled, and some that stay so because of their boundary.
std::vector<RunToStop> runs_until_valid() {
  std::vector<RunToStop> runs = tangled_runs();
  const auto add = [&](const std::string& name, HighOrderMesh mesh) {
    runs.push_back(testing::run_to_stop(name, std::move(mesh), [](Options&) {}));
  };
  add("sphere", read_case("sphere_p3.msh"));
  add("two_in_a_ball", testing::two_in_a_ball(3));
  HighOrderMesh six = testing::six_in_a_ball(3);
  testing::shake(six, 0.3, 11);
  add("six_in_a_ball", std::move(six));
  add("tetrahedra_pushed_far", pushed(testing::Filling::Tetrahedra, {3, 3, 3}, 2, 0.35));
  add("hexahedra_pushed_far", pushed(testing::Filling::Hexahedra, {3, 3, 2}, 2, 0.4));
  return runs;
}

/// What iterations have in common if they are the same: all but their times.
auto substance(const Iteration& i) {
  return std::tuple(i.phase, i.number, i.energy, i.residual, i.invalid_elements, i.left_elements, i.active_nodes);
}

class RunUntilValid : public ::testing::TestWithParam<RunToStop> {};

TEST_P(RunUntilValid, IsTheBeginningOfEveryOtherRun) {
  Options options = GetParam().options;
  for (const Objective objective : {Objective::Auto, Objective::Energy, Objective::Worst}) {
    options.objective = objective;
    options.until = Until::Valid;
    const auto until_valid = optimise(GetParam().mesh, options);
    options.until = Until::Tolerance;
    const auto whole = optimise(GetParam().mesh, options);
    ASSERT_TRUE(until_valid && whole);
    ASSERT_LE(until_valid->history.size(), whole->history.size());
    for (std::size_t i = 0; i < until_valid->history.size(); ++i)
      ASSERT_EQ(substance(until_valid->history[i]), substance(whole->history[i]))
          << "iteration " << i + 1 << ", objective " << int(objective);
    EXPECT_LE(uncertified(*whole), uncertified(*until_valid)) << "objective " << int(objective);
  }
}

INSTANTIATE_TEST_SUITE_P(Meshes, RunUntilValid, ::testing::ValuesIn(runs_until_valid()),
                         [](const auto& info) { return info.param.name; });

TEST(ValidMesh, StaysAsItCameIfItsMinimumAndItsMeanWouldFall) {
  Options options = testing::for_energy();
  options.threads = 1;
  const HighOrderMesh mesh = read_case("cylinder_p2.msh");
  const auto result = optimise(mesh, options);
  ASSERT_TRUE(result) << result.error().sentence;
  ASSERT_TRUE(result->before.uncertified.empty());
  EXPECT_GT(result->iterations, 0);
  EXPECT_EQ(result->mesh.coordinates, mesh.coordinates);
  EXPECT_EQ(result->after.min_scaled_jacobian, result->before.min_scaled_jacobian);
  EXPECT_EQ(result->after.mean_scaled_jacobian, result->before.mean_scaled_jacobian);
  EXPECT_NE(result->kept_as_it_came.find("the objective worst"), std::string::npos) << result->kept_as_it_came;
  EXPECT_NE(result->kept_as_it_came.find("0.522 and 0.963"), std::string::npos) << result->kept_as_it_came;
}

TEST(ValidMesh, IsChangedIfOnlyOneOfThemFalls) {
  Options options = testing::for_energy();
  options.threads = 1;
  const HighOrderMesh mesh = read_case("annulus_p3.msh");
  const auto result = optimise(mesh, options);
  ASSERT_TRUE(result) << result.error().sentence;
  EXPECT_NE(result->mesh.coordinates, mesh.coordinates);
  EXPECT_EQ(result->kept_as_it_came, "");
}

/// Six rows of quadrilaterals of order 2 between two circles, the first .02 high, each `growth` times as high as the
/// one before. The outer circles are curved, and the more a row lies inside, the less.
HighOrderMesh layers_that_follow_a_circle(double growth) {
  std::vector<double> radii = {1};
  for (double height = 0.02; radii.size() < 7; height *= growth) radii.push_back(radii.back() + height);
  constexpr int kColumns = 8;
  HighOrderMesh mesh = *change_order(testing::ring_mesh(radii, kColumns), 2);
  const double sector = 2 * std::numbers::pi / kColumns, outer = radii.back();
  for (std::size_t n = 0; n < mesh.node_count(); ++n) {
    double* x = &mesh.coordinates[3 * n];
    const double angle = std::atan2(x[1], x[0]), part = std::abs(std::remainder(angle, sector));
    if (part < 0.25 * sector) continue;  // at the end of a chord, not in its middle
    const double radius = std::hypot(x[0], x[1]) / std::cos(sector / 2);
    const double share = radius > outer - 1e-9 ? 1 : (outer - radius) / (outer - 1);
    for (int c = 0; c < 2; ++c) x[c] *= 1 + share * (1 / std::cos(sector / 2) - 1);
  }
  return mesh;
}

// Without this rule a solver's error for an erf rose to 1.5 and 1.7 times the start's, while the mean over all profiles
// fell.
TEST(ValidMesh, HoldsNoLessInItsLayers) {
  Options options;
  options.threads = 1;
  for (const double growth : {1.5, 1.9, 2.2, 2.4}) {
    const auto result = optimise(layers_that_follow_a_circle(growth), options);
    ASSERT_TRUE(result) << result.error().sentence;
    ASSERT_TRUE(result->before.uncertified.empty() && result->before.in_layers && result->after.in_layers) << growth;
    const auto &before = result->before.in_layers->of_profiles, &after = result->after.in_layers->of_profiles;
    ASSERT_EQ(before.size(), after.size()) << growth;
    for (std::size_t k = 0; k < before.size(); ++k)
      EXPECT_LE(after[k], 1.02 * before[k]) << growth << ", profile " << k;
    EXPECT_LE(result->after.accuracy->loss, result->before.accuracy->loss) << growth;
  }
}

/// Eight of its elements cannot be repaired.
TEST(InvalidMesh, HasNoHigherLossInTheEndIfNoMoreElementsAreCertified) {
  const char* folder = std::getenv("VARIMESH_CASES");
  const std::filesystem::path path =
      std::filesystem::path(folder ? folder : VARIMESH_SOURCE_DIR "/../shared/cases") / "meshes" / "cylprism_p2.msh";
  if (!std::filesystem::exists(path))
    GTEST_SKIP() << "NOT RUN: the shared cases are not at " << path << "; set VARIMESH_CASES to their folder.";
  const auto file = formats::read_file(path.string());
  ASSERT_TRUE(file) << file.error().sentence;
  Options options;
  options.threads = 1;
  const auto once = optimise(file->mesh, options);
  ASSERT_TRUE(once);
  const auto again = optimise(once->mesh, options);
  ASSERT_TRUE(again && again->before.accuracy && again->after.accuracy);
  EXPECT_EQ(uncertified(*again), std::ssize(again->before.uncertified));
  EXPECT_LE(again->after.accuracy->loss, again->before.accuracy->loss);
}

}  // namespace
}  // namespace varimesh
