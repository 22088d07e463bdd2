// A run by hand: how it begins, what each iteration notes, how it goes on from a checkpoint, and the best mesh seen.
#include "core/optimise/stage_run.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "core/energy/material.h"
#include "core/mesh/connectivity.h"
#include "core/problem/targets.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

/// A mesh with all that a run works with.
class Workbench {
 public:
  Workbench(HighOrderMesh mesh, const Options& options)
      : options_(options), mesh_(std::move(mesh)), frame_(frame_of(mesh_)), certifier_(mesh_), best_(certifier_) {
    problem_ = build_problem(mesh_, fixed_nodes(mesh_), options_.quadrature_degree);
    problem_.positions = solver_positions(mesh_, frame_);
    set_straight_sided_targets(problem_);
    coloured_ = colour_nodes(problem_, options_.colouring);
    kernels_ = make_kernels(material(options_), mesh_.dimension);
    hessian_ = make_hessian_kernels(material(options_), mesh_.dimension);
    std::vector<Certificate> certificates(certifier_.cells());
    certifier_.certify(mesh_.coordinates, certificates, team_);
    guard_ = std::make_unique<Guard>(mesh_, frame_, problem_, certifier_, std::move(certificates), team_);
    run_ = std::make_unique<StageRun>(
        StageContext{options_, problem_, coloured_, *kernels_, hessian_.get(), *guard_, best_, team_, mesh_, {}},
        Stopwatch());
  }

  /// `count` iterations, or until the run ends.
  std::optional<StopReason> steps(int count) {
    std::optional<StopReason> reason;
    for (int i = 0; i < count && !reason; ++i) reason = run_->step();
    return reason;
  }

  std::string checkpoint(std::uint64_t fingerprint) {
    std::string bytes;
    EXPECT_TRUE(run_->write(
        [&](std::string_view part) {
          bytes += part;
          return true;
        },
        fingerprint));
    return bytes;
  }

  StageRun& run() { return *run_; }
  Guard& guard() { return *guard_; }
  BestMesh& best() { return best_; }
  Problem& problem() { return problem_; }

 private:
  Options options_;
  HighOrderMesh mesh_;
  Frame frame_;
  Certifier certifier_;
  BestMesh best_;
  Team team_{1};
  Problem problem_;
  ColouredNodes coloured_;
  std::unique_ptr<Kernels> kernels_;
  std::unique_ptr<HessianKernels> hessian_;
  std::unique_ptr<Guard> guard_;
  std::unique_ptr<StageRun> run_;
};

HighOrderMesh curved(double shake = 0.01) {
  HighOrderMesh mesh = testing::grid(Filling::MixedPlane, {3, 3, 0}, 3, testing::bent(2));
  testing::shake(mesh, shake, 3);
  return mesh;
}

Options by(Method method) {
  Options options;
  options.method = method;
  return options;
}

TEST(RunBegin, GoesOnByDefault) { EXPECT_EQ(Workbench(curved(), {}).run().begin(), std::nullopt); }

TEST(RunBegin, EndsIfThereIsNothingToDo) {
  Options options;
  options.until = Until::Valid;
  EXPECT_EQ(Workbench(curved(), options).run().begin(), StopReason::Valid);
  EXPECT_EQ(Workbench(testing::read_case("nine_triangles.msh"), options).run().begin(), std::nullopt);
  options.max_iterations = 0;
  EXPECT_EQ(Workbench(testing::read_case("nine_triangles.msh"), options).run().begin(), StopReason::Iterations);
}

TEST(RunStep, NumbersAndNotesEveryIteration) {
  Workbench bench(curved(), by(Method::Sweeps));
  bench.run().begin();
  EXPECT_EQ(bench.steps(3), std::nullopt);
  EXPECT_EQ(bench.run().last().number, 3);
  const std::vector<Iteration> history = bench.run().take_history();
  ASSERT_EQ(history.size(), 3U);
  for (std::size_t i = 0; i < history.size(); ++i) {
    EXPECT_EQ(history[i].number, static_cast<int>(i) + 1);
    EXPECT_EQ(history[i].phase, Phase::Sweeps);
    EXPECT_EQ(history[i].active_nodes, static_cast<std::int64_t>(bench.problem().free.size()));
    EXPECT_EQ(history[i].invalid_elements, 0);
    EXPECT_GT(history[i].residual, 0);
  }
  EXPECT_EQ(history[0].relative_gradient, 1);
  EXPECT_LT(history[2].relative_gradient, 1);
  EXPECT_LT(history[2].energy, history[0].energy);
}

TEST(RunStep, TakesNewtonStepsOnAValidMesh) {
  Workbench bench(curved(), {});
  bench.run().begin();
  bench.run().step();
  EXPECT_EQ(bench.run().last().phase, Phase::Newton);
  EXPECT_GT(bench.run().last().products, 0);
}

TEST(RunStep, EndsWhenItConverges) {
  for (const Method method : {Method::Auto, Method::Newton}) {
    Workbench bench(curved(), by(method));
    bench.run().begin();
    EXPECT_EQ(bench.steps(30), StopReason::Converged);
    EXPECT_TRUE(bench.run().converged());
    EXPECT_LE(bench.run().last().residual, Options{}.tolerance);
  }
}

TEST(RunStep, MayBeWrittenAfterEveryNewtonStepAndEveryTenthSweep) {
  Workbench newton(curved(), by(Method::Newton)), sweeps(curved(), by(Method::Sweeps));
  newton.run().begin();
  sweeps.run().begin();
  EXPECT_FALSE(newton.run().can_be_kept()) << "no iteration was made yet";
  for (int number = 1; number <= 20; ++number) {
    sweeps.run().step();
    EXPECT_EQ(sweeps.run().can_be_kept(), number % 10 == 0) << number;
  }
  newton.run().step();
  EXPECT_TRUE(newton.run().can_be_kept());
}

class RunResume : public ::testing::TestWithParam<Method> {};

INSTANTIATE_TEST_SUITE_P(
    Methods, RunResume, ::testing::Values(Method::Auto, Method::Sweeps, Method::Newton), [](const auto& info) {
      return std::string(info.param == Method::Auto ? "Auto" : info.param == Method::Sweeps ? "Sweeps" : "Newton");
    });

TEST_P(RunResume, GoesOnToTheSameBits) {
  // Ten sweeps or two Newton steps are made before the checkpoint, and as many after it.
  const int half = GetParam() == Method::Sweeps ? 10 : 2;
  Workbench whole(curved(), by(GetParam())), part(curved(), by(GetParam()));
  for (Workbench* bench : {&whole, &part}) {
    bench->run().begin();
    bench->steps(half);
  }
  const std::string kept = part.checkpoint(4711);
  whole.steps(half);
  Workbench resumed(curved(), by(GetParam()));
  ASSERT_TRUE(resumed.run().resume(kept, 4711));
  EXPECT_EQ(resumed.run().last().number, half);
  resumed.steps(half);
  EXPECT_EQ(resumed.problem().positions, whole.problem().positions);
  EXPECT_EQ(resumed.run().last().energy, whole.run().last().energy);
  EXPECT_EQ(resumed.run().take_history().size(), whole.run().take_history().size());
}

TEST_P(RunResume, RefusesWhatIsNotItsOwn) {
  Workbench bench(curved(), by(GetParam()));
  bench.run().begin();
  bench.steps(GetParam() == Method::Sweeps ? 10 : 1);
  const std::string kept = bench.checkpoint(4711);
  EXPECT_FALSE(Workbench(curved(), by(GetParam())).run().resume(kept, 4712));
  EXPECT_FALSE(Workbench(curved(), by(GetParam())).run().resume(kept.substr(0, kept.size() / 2), 4711));
  EXPECT_FALSE(Workbench(curved(), by(GetParam())).run().resume("", 4711));
  // The same fingerprint by accident, but another number of nodes.
  const HighOrderMesh other = testing::grid(Filling::Triangles, {2, 2, 0}, 2);
  EXPECT_FALSE(Workbench(other, by(GetParam())).run().resume(kept, 4711));
}

TEST(RunFollow, NumbersGoOnFromTheRunBefore) {
  Workbench first(curved(), by(Method::Sweeps)), second(curved(), by(Method::Sweeps));
  first.run().begin();
  first.steps(3);
  const double gradient = first.run().last().relative_gradient;
  second.run().follow(first.run().carry_over());
  second.run().begin();
  second.run().step();
  EXPECT_EQ(second.run().last().number, 4);
  EXPECT_GT(second.run().last().relative_gradient, gradient) << "relative to the first run's first gradient";
  EXPECT_EQ(second.run().take_history().size(), 4U);
}

TEST(BestMesh, KeepsTheMeshWithTheHighestProvedMinimum) {
  Workbench bench(curved(0), {});
  const double first = bench.best().consider(bench.guard());
  EXPECT_GT(first, 0);
  EXPECT_EQ(bench.best().merit().smallest, first);
  const std::vector<double> coordinates = bench.best().coordinates();
  EXPECT_EQ(coordinates, bench.guard().coordinates());
  // A valid mesh, but a worse one.
  const auto node = static_cast<std::size_t>(bench.problem().free[0]);
  bench.problem().positions[2 * node] += 0.02;
  bench.guard().certify_moved();
  ASSERT_EQ(bench.guard().uncertified(), 0);
  ASSERT_NE(bench.guard().coordinates(), coordinates);
  EXPECT_LT(bench.best().consider(bench.guard()), first);
  EXPECT_EQ(bench.best().merit().smallest, first);
  EXPECT_EQ(bench.best().coordinates(), coordinates);
}

TEST(BestMesh, PrefersFewerUncertifiedCellsToAHigherMinimum) {
  Workbench bench(testing::read_case("nine_triangles.msh"), {});
  bench.best().consider(bench.guard());
  const std::vector<double> tangled = bench.best().coordinates();
  ASSERT_GT(bench.guard().uncertified(), 0);
  bench.run().begin();
  bench.steps(100);
  ASSERT_EQ(bench.guard().uncertified(), 0);
  bench.best().consider(bench.guard());
  EXPECT_NE(bench.best().coordinates(), tangled);
  EXPECT_EQ(bench.best().coordinates(), bench.guard().coordinates());
}

}  // namespace
}  // namespace varimesh
