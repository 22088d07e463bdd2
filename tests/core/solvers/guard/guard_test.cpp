// No certificate is lost, whatever the energy does and whenever a run is stopped.
#include "core/solvers/guard/guard.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <random>

#include "core/mesh/connectivity.h"
#include "core/optimise/optimiser.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/for_energy.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::read_case;

std::vector<bool> valid_cells(const HighOrderMesh& mesh) {
  std::vector<bool> valid;
  for (const Certificate& certificate : certify(mesh, {}, 1)) valid.push_back(certificate.is_valid());
  return valid;
}

class GuardTest : public ::testing::TestWithParam<Filling> {
 protected:
  void SetUp() override {
    mesh_ = testing::grid(GetParam(), {3, 3, 2}, 3, testing::bent(testing::is_plane(GetParam()) ? 2 : 3));
    frame_ = frame_of(mesh_);
    problem_ = build_problem(mesh_, fixed_nodes(mesh_), 0);
    problem_.positions = solver_positions(mesh_, frame_);
    certifier_.emplace(mesh_);
    std::vector<Certificate> certificates(certifier_->cells());
    certifier_->certify(mesh_.coordinates, certificates, team_);
    guard_.emplace(mesh_, frame_, problem_, *certifier_, std::move(certificates), team_);
  }

  /// Moves one in `every` free nodes by up to `size` in each coordinate.
  void shake(double size, std::size_t every = 1) {
    std::uniform_real_distribution<double> push(-size, size);
    for (std::size_t rank = 0; rank < problem_.free.size(); rank += every) {
      const std::int32_t node = problem_.free[rank];
      for (int k = 0; k < problem_.dimension; ++k)
        problem_.positions[static_cast<std::size_t>(node) * problem_.dimension + k] += push(random_);
    }
  }

  std::vector<bool> kept() const {
    HighOrderMesh mesh = mesh_;
    mesh.coordinates = guard_->coordinates();
    return valid_cells(mesh);
  }

  HighOrderMesh mesh_;
  Frame frame_;
  Problem problem_;
  Team team_{1};
  std::mt19937_64 random_{5};
  std::optional<Certifier> certifier_;
  std::optional<Guard> guard_;
};

TEST_P(GuardTest, KeepsEveryStateThatLosesNothing) {
  ASSERT_EQ(guard_->uncertified(), 0);
  shake(1e-3);
  guard_->certify_moved();
  ASSERT_EQ(guard_->uncertified(), 0);
  EXPECT_EQ(guard_->coordinates(),
            file_coordinates(mesh_, frame_, solver_positions(mesh_, frame_), problem_.positions));
}

TEST_P(GuardTest, KeepsItsStateWhereverItIsInterrupted) {
  shake(1e-3);
  guard_->certify_moved();
  const std::vector<double> good = guard_->coordinates(), good_positions = problem_.positions;
  shake(1e-3);
  const std::vector<double> moved = problem_.positions;
  int looks = 0;
  for (bool interrupted = true; interrupted; ++looks) {
    problem_.positions = moved;
    int left = looks;
    const StopToken token([&] { return left-- == 0; });
    team_.set_stop(&token);
    try {
      guard_->certify_moved();
      interrupted = false;
    } catch (const Interrupted&) {
      ASSERT_EQ(guard_->coordinates(), good) << looks << " looks";
    }
    team_.set_stop(nullptr);
    if (!interrupted) continue;
    // The nodes go back. What the interrupted call has computed about them must not count.
    problem_.positions = good_positions;
    guard_->certify_moved();
    ASSERT_EQ(guard_->coordinates(), good) << looks << " looks";
  }
  EXPECT_GT(looks, 3);
  EXPECT_EQ(guard_->coordinates(), file_coordinates(mesh_, frame_, solver_positions(mesh_, frame_), moved));
}

TEST_P(GuardTest, PutsBackWhatWasLostAndNoMore) {
  shake(1e-3);
  guard_->certify_moved();
  const std::vector<double> good = guard_->coordinates();
  shake(1e-4);
  shake(0.1, problem_.free.size() / 4 + 1);
  guard_->certify_moved();
  ASSERT_GT(guard_->lost(), 0) << "the shaking should spoil some cells";
  ASSERT_LT(guard_->lost(), static_cast<std::int64_t>(certifier_->cells()))
      << "the shaking should leave some cells valid";
  EXPECT_EQ(guard_->coordinates(), good);
  const std::vector<double> wanted = problem_.positions;
  guard_->restore_lost();
  EXPECT_EQ(guard_->lost(), 0);
  EXPECT_EQ(problem_.positions, wanted);
  for (const bool valid : kept()) EXPECT_TRUE(valid);
  EXPECT_NE(guard_->coordinates(), good) << "nodes of other cells keep their new places";
}

TEST_P(GuardTest, CertifiesWhatMovedAsIfItWereAll) {
  for (int round = 0; round < 5; ++round) {
    std::uniform_int_distribution<std::size_t> any(0, problem_.free.size() - 1);
    const std::size_t node = problem_.free[any(random_)];
    problem_.positions[node * problem_.dimension] += 0.05 * round;
    guard_->certify_moved();
    HighOrderMesh moved = mesh_;
    moved.coordinates = file_coordinates(mesh_, frame_, solver_positions(mesh_, frame_), problem_.positions);
    const std::vector<bool> valid = valid_cells(moved);
    EXPECT_EQ(guard_->uncertified(), std::count(valid.begin(), valid.end(), false));
  }
}

INSTANTIATE_TEST_SUITE_P(Fillings, GuardTest, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return std::string(testing::name(info.param)); });

/// Meshes with valid and invalid cells, optimised and stopped after every iteration in turn.
class StoppedRun : public ::testing::TestWithParam<std::tuple<Filling, Energy>> {};

TEST_P(StoppedRun, LosesNoCertificateWhicheverIterationItEndsAt) {
  const auto [filling, energy] = GetParam();
  const HighOrderMesh whole = testing::grid(filling, {2, 2, 2}, 2, testing::bent(testing::is_plane(filling) ? 2 : 3));
  HighOrderMesh mesh;
  std::vector<bool> before;
  for (double size = 0.05; std::find(before.begin(), before.end(), false) == before.end(); size += 0.005) {
    mesh = whole;
    testing::shake(mesh, size, 11);
    before = valid_cells(mesh);
  }
  ASSERT_GT(std::count(before.begin(), before.end(), true), 0);
  ASSERT_GT(std::count(before.begin(), before.end(), false), 0);
  const std::vector<bool> fixed = fixed_nodes(mesh);
  for (const Method method : {Method::Auto, Method::Sweeps, Method::Newton})
    for (int last = 1; last <= 6; ++last) {
      Options options = testing::for_energy();
      options.energy = energy;
      options.method = method;
      options.threads = 1;
      const auto result = optimise(mesh, options, [&](const Iteration& iteration) {
        return iteration.number == last ? Control::Stop : Control::Continue;
      });
      ASSERT_TRUE(result) << result.error().sentence;
      const std::vector<bool> after = valid_cells(result->mesh);
      for (std::size_t cell = 0; cell < before.size(); ++cell)
        EXPECT_TRUE(!before[cell] || after[cell]) << "cell " << cell << " is lost at iteration " << last;
      EXPECT_EQ(result->after.certified.valid, std::count(after.begin(), after.end(), true));
      for (std::size_t node = 0; node < fixed.size(); ++node)
        for (std::size_t k = 3 * node; fixed[node] && k < 3 * node + 3; ++k)
          ASSERT_EQ(result->mesh.coordinates[k], mesh.coordinates[k]);
    }
}

INSTANTIATE_TEST_SUITE_P(Fillings, StoppedRun,
                         ::testing::Combine(::testing::ValuesIn(testing::kFillings),
                                            ::testing::Values(Energy::Hyperelastic, Energy::LinearElastic,
                                                              Energy::Winslow, Energy::Distortion)),
                         [](const auto& info) {
                           std::string energy(name(std::get<1>(info.param)));
                           std::ranges::replace(energy, '-', '_');
                           return testing::name(std::get<0>(info.param)) + ("_" + energy);
                         });

TEST(RunStopsAt, TheFirstMeshThatIsCertifiedValid) {
  Options options;
  options.until = Until::Valid;
  const auto result = optimise(read_case("nine_triangles.msh"), options);
  ASSERT_TRUE(result) << result.error().sentence;
  EXPECT_EQ(result->stop_reason, StopReason::Valid);
  EXPECT_EQ(result->after.certified.valid, 9);
  EXPECT_GT(result->history.size(), 0U);
  EXPECT_FALSE(result->converged);
  for (std::size_t i = 0; i + 1 < result->history.size(); ++i) EXPECT_GT(result->history[i].invalid_elements, 0);
}

TEST(RunStopsAt, AMeshThatIsValidAlreadyBeforeTheFirstIteration) {
  Options options;
  options.until = Until::Valid;
  const HighOrderMesh mesh = read_case("annulus_p3.msh");
  const auto result = optimise(mesh, options);
  ASSERT_TRUE(result) << result.error().sentence;
  EXPECT_EQ(result->stop_reason, StopReason::Valid);
  EXPECT_EQ(result->iterations, 0);
  EXPECT_EQ(result->mesh.coordinates, mesh.coordinates);
}

TEST(RunStopsAt, AProvedScaledJacobianAndReturnsTheBest) {
  Options options = testing::for_energy();
  const auto whole = optimise(read_case("annulus_p3.msh"), options);
  ASSERT_TRUE(whole) << whole.error().sentence;
  const double start = whole->before.certified.min_scaled_jacobian_lower_bound;
  options.until_js = 0.5 * (start + whole->after.certified.min_scaled_jacobian_lower_bound);
  const auto part = optimise(read_case("annulus_p3.msh"), options);
  ASSERT_TRUE(part) << part.error().sentence;
  EXPECT_EQ(part->stop_reason, StopReason::Quality);
  EXPECT_GE(part->after.certified.min_scaled_jacobian_lower_bound, options.until_js);
  EXPECT_LT(part->iterations, whole->iterations);
}

TEST(RunStopsAt, TheTimeLimit) {
  Options options;
  options.time_limit = 1e-9;
  const auto result = optimise(read_case("annulus_p3.msh"), options);
  ASSERT_TRUE(result) << result.error().sentence;
  EXPECT_EQ(result->stop_reason, StopReason::TimeLimit);
}

}  // namespace
}  // namespace varimesh
