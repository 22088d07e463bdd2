// Raising in the middle of a run: what has lost its certificate gets it back, and nodes far from it stay.
#include "core/solvers/maxmin/kept_raiser.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>

#include "core/base/index.h"
#include "core/mesh/connectivity.h"
#include "core/problem/node_conversion.h"
#include "core/problem/sizes.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

class KeptRaiserTest : public ::testing::Test {
 protected:
  void begin(HighOrderMesh mesh, int threads = 1) {
    mesh_ = std::move(mesh);
    team_.emplace(threads);
    team_->run([&] {
      frame_ = frame_of(mesh_, *team_);
      problem_ = build_problem(mesh_, fixed_nodes(mesh_), 0);
      problem_.positions = solver_positions(mesh_, frame_, *team_);
      set_sizes(problem_);
      certifier_.emplace(mesh_);
      std::vector<Certificate> certificates(certifier_->cells());
      certifier_->certify(mesh_.coordinates, certificates, *team_);
      guard_.emplace(mesh_, frame_, problem_, *certifier_, std::move(certificates), *team_);
      raiser_.emplace(mesh_, problem_, *guard_, *team_);
    });
  }

  /// Moves a free node until the cells around it have lost their certificate. Returns the node.
  std::int32_t tangle() {
    const std::int32_t node = problem_.free[problem_.free.size() / 2];
    while (guard_->lost() == 0) {
      problem_.positions[3 * at(node)] += 0.02;
      guard_->certify_moved();
    }
    return node;
  }

  HighOrderMesh mesh_;
  Frame frame_;
  Problem problem_;
  std::optional<Team> team_;
  std::optional<Certifier> certifier_;
  std::optional<Guard> guard_;
  std::optional<KeptRaiser> raiser_;
};

TEST_F(KeptRaiserTest, GivesLostCertificatesBack) {
  std::vector<double> first;
  for (const int threads : {1, 2}) {
    begin(testing::grid(testing::Filling::Tetrahedra, {4, 4, 4}, 3, testing::bent(3)), threads);
    team_->run([&] {
      ASSERT_EQ(guard_->uncertified(), 0);
      const std::int32_t tangled = tangle();
      const std::vector<double> before = problem_.positions;
      EXPECT_TRUE(raiser_->raise_lost());
      guard_->certify_moved();
      EXPECT_EQ(guard_->lost(), 0);
      EXPECT_EQ(guard_->uncertified(), 0);
      std::size_t same = 0;
      for (const std::int32_t node : problem_.free)
        same += std::equal(&before[3 * at(node)], &before[3 * at(node)] + 3, &problem_.positions[3 * at(node)]) ? 1 : 0;
      EXPECT_GT(same, problem_.free.size() / 4) << "the patch is around node " << tangled;
    });
    if (first.empty()) first = problem_.positions;
    EXPECT_EQ(problem_.positions, first) << threads << " threads";
  }
}

TEST_F(KeptRaiserTest, LeavesWhatWasNeverCertified) {
  begin(testing::read_case("sphere_p3.msh"));
  team_->run([&] {
    ASSERT_EQ(guard_->uncertified(), 11);
    ASSERT_EQ(guard_->lost(), 0);
    const std::vector<double> before = problem_.positions;
    EXPECT_FALSE(raiser_->raise_lost());
    EXPECT_EQ(problem_.positions, before);
  });
}

TEST_F(KeptRaiserTest, RaisesTheKeptStateInSteps) {
  begin(testing::read_case("sphere_p3.msh"));
  team_->run([&] {
    bool finished = false;
    for (int step = 0; step < 20 && !finished; ++step) {
      finished = raiser_->step().finished;
      guard_->certify_moved();
      EXPECT_EQ(guard_->lost(), 0);
    }
    EXPECT_TRUE(finished);
    EXPECT_LE(guard_->uncertified(), 1);
  });
}

}  // namespace
}  // namespace varimesh
