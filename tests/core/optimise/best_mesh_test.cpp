// What a run hands out is never worse for having gone on, and never worse than a mesh that came in valid.
#include <gtest/gtest.h>

#include <string>
#include <tuple>

#include "core/validity/certificate.h"
#include "tests/core/optimise/stopped_runs.h"
#include "tests/core/support/for_energy.h"

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

}  // namespace
}  // namespace varimesh
