// Untangling repairs what can be repaired, and leaves the rest of the mesh as it was.
#include "core/solvers/untangle/untangle.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <random>

#include "core/formats/formats.h"
#include "core/mesh/connectivity.h"
#include "core/optimise/optimiser.h"
#include "tests/core/support/for_energy.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

/// A mesh with some of its free nodes moved, and everything that untangling needs.
class TangledMesh {
 public:
  TangledMesh(HighOrderMesh mesh, double push, int threads)
      : mesh_(std::move(mesh)), frame_(frame_of(mesh_)), certifier_(mesh_), team_(threads) {
    problem_ = build_problem(mesh_, fixed_nodes(mesh_), 0);
    problem_.positions = solver_positions(mesh_, frame_);
    set_straight_sided_targets(problem_);
    // Every twentieth free node is moved, in the file's coordinates too.
    const std::vector<double> before = problem_.positions;
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> far(-push, push);
    for (std::size_t f = 0; f < problem_.free.size(); f += 20)
      for (int k = 0; k < problem_.dimension; ++k)
        problem_.positions[std::size_t(problem_.free[f] * problem_.dimension + k)] += far(random);
    mesh_.coordinates = file_coordinates(mesh_, frame_, before, problem_.positions);
    kernels_ = make_kernels(material(Options()), mesh_.dimension);
    std::vector<Certificate> certificates(certifier_.cells());
    certifier_.certify(mesh_.coordinates, certificates, team_);
    guard_.emplace(mesh_, frame_, problem_, certifier_, std::move(certificates), team_);
  }

  /// Untangles to the end; returns the number of outer steps.
  int untangle(Untangler::Depth depth = {}) {
    int steps = 0;
    team_.run([&] {
      Untangler untangler(problem_, *kernels_, *guard_, team_, failed_starts_, depth);
      do {
        untangler.step();
        guard_->certify_moved();
        untangler.judge();
        ++steps;
      } while (!untangler.done() && steps < 1000);
      guard_->restore_lost();
    });
    return steps;
  }

  Guard& guard() { return *guard_; }
  Problem& problem() { return problem_; }
  const HighOrderMesh& mesh() const { return mesh_; }

 private:
  HighOrderMesh mesh_;
  Frame frame_;
  Certifier certifier_;
  Team team_;
  Problem problem_;
  std::unique_ptr<Kernels> kernels_;
  std::optional<Guard> guard_;
  Untangler::FailedStarts failed_starts_;
};

class UntangleShapes : public ::testing::TestWithParam<Filling> {
 protected:
  static HighOrderMesh mesh() {
    return testing::grid(GetParam(), {3, 3, 2}, 2, testing::bent(testing::is_plane(GetParam()) ? 2 : 3));
  }
};

TEST_P(UntangleShapes, RepairsEveryCell) {
  TangledMesh tangled(mesh(), 0.15, 1);
  ASSERT_GT(tangled.guard().uncertified(), 0);
  const int steps = tangled.untangle();
  EXPECT_LT(steps, 60);
  EXPECT_EQ(tangled.guard().uncertified(), 0);
}

TEST_P(UntangleShapes, LeavesFixedNodesAsTheyAre) {
  TangledMesh tangled(mesh(), 0.15, 1);
  const std::vector<bool> fixed = fixed_nodes(tangled.mesh());
  tangled.untangle();
  const std::vector<double>& after = tangled.guard().coordinates();
  for (std::size_t n = 0; n < fixed.size(); ++n)
    for (std::size_t k = 0; k < 3 && fixed[n]; ++k) EXPECT_EQ(after[3 * n + k], tangled.mesh().coordinates[3 * n + k]);
  EXPECT_NE(after, tangled.mesh().coordinates);
}

TEST_P(UntangleShapes, DoesNotDependOnTheNumberOfThreads) {
  TangledMesh one(mesh(), 0.15, 1), four(mesh(), 0.15, 4);
  EXPECT_EQ(one.untangle(), four.untangle());
  EXPECT_EQ(one.guard().coordinates(), four.guard().coordinates());
}

INSTANTIATE_TEST_SUITE_P(Fillings, UntangleShapes, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return std::string(testing::name(info.param)); });

/// A cube of tetrahedra with one boundary edge that folds over itself. The tetrahedra on that edge cannot be repaired.
HighOrderMesh unrepairable_cube() {
  HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {3, 3, 3}, 2);
  const std::vector<bool> fixed = fixed_nodes(mesh);
  const Cells cells(mesh, 3);
  for (std::size_t cell = 0; cell < cells.count(); ++cell)
    for (std::size_t edge = 0; edge < 6; ++edge) {
      const auto nodes = cells.nodes(cell);
      const auto ends = reference::info(Shape::Tetrahedron).edges[edge];
      const std::size_t middle = std::size_t(nodes[4 + edge]);
      if (!fixed[middle]) continue;
      for (std::size_t k = 0; k < 3; ++k)
        mesh.coordinates[3 * middle + k] = 0.9 * mesh.coordinates[3 * std::size_t(nodes[std::size_t(ends[0])]) + k] +
                                           0.1 * mesh.coordinates[3 * std::size_t(nodes[std::size_t(ends[1])]) + k];
      return mesh;
    }
  return mesh;
}

TEST(Untangle, EndsIfNothingCanBeRepairedAndPutsEverythingBack) {
  TangledMesh tangled(unrepairable_cube(), 0, 1);
  const std::int64_t before = tangled.guard().uncertified();
  ASSERT_GT(before, 0);
  const std::vector<double> positions = tangled.problem().positions;
  EXPECT_LT(tangled.untangle(), 100);
  EXPECT_EQ(tangled.guard().uncertified(), before);
  EXPECT_EQ(tangled.problem().positions, positions);
}

TEST(Untangle, StartsNoPatchAgainAroundCellsThatItHasGivenUp) {
  TangledMesh tangled(unrepairable_cube(), 0, 1);
  EXPECT_GT(tangled.untangle(), 1);
  EXPECT_EQ(tangled.untangle(), 1) << "there is no patch, so the first step is the last";
}

TEST(Untangle, KeepsUnrepairableCellsOutOfTheBarrier) {
  TangledMesh tangled(unrepairable_cube(), 0.15, 1);
  const std::vector<UnrepairableGroup> groups = diagnose(unrepairable_cube(), 1);
  ASSERT_FALSE(groups.empty());
  tangled.guard().set_unrepairable(groups);
  ASSERT_GT(tangled.guard().repairable(), 0);
  tangled.untangle();
  EXPECT_EQ(tangled.guard().repairable(), 0);
  EXPECT_GT(tangled.guard().uncertified(), 0);
}

// ---------------------------------------------------------------------------------------------------------------------
// Shared cases
// ---------------------------------------------------------------------------------------------------------------------

/// The shared case of that name, or nothing if the shared cases are not there.
std::optional<HighOrderMesh> shared_case(const std::string& name) {
  const char* folder = std::getenv("VARIMESH_CASES");
  const auto path = std::filesystem::path(folder ? folder : VARIMESH_SOURCE_DIR "/../shared/cases") / "meshes" / name;
  if (!std::filesystem::exists(path)) return std::nullopt;
  auto file = formats::read_file(path.string());
  EXPECT_TRUE(file);
  return file ? std::optional(std::move(file->mesh)) : std::nullopt;
}

/// A boundary layer with two tangled cells. They can be repaired only if many cells around them move too.
TEST(Untangle, MovesABoundaryLayerAsAWhole) {
  const auto mesh = shared_case("nacabl_p4.msh");
  if (!mesh) GTEST_SKIP() << "NOT RUN: the shared cases are not there; set VARIMESH_CASES to their folder.";
  Options options;
  options.until = Until::Valid;
  const auto result = optimise(*mesh, options);
  ASSERT_TRUE(result) << result.error().sentence;
  EXPECT_EQ(result->stop_reason, StopReason::Valid);
  EXPECT_EQ(result->history.back().phase, Phase::Untangle);
}

TEST(Untangle, MakesLostCellsValidWhereTheyAre) {
  // A valid mesh moves: all of it by a little, and one node too far.
  const HighOrderMesh mesh = testing::grid(Filling::Triangles, {8, 8, 1}, 3);
  const Frame frame = frame_of(mesh);
  Problem problem = build_problem(mesh, fixed_nodes(mesh), 0);
  problem.positions = solver_positions(mesh, frame);
  set_straight_sided_targets(problem);
  const Certifier certifier(mesh);
  const Team team(2);
  const auto kernels = make_kernels(material(Options()), 2);
  std::vector<Certificate> certificates(certifier.cells());
  team.run([&] {
    certifier.certify(mesh.coordinates, certificates, team);
    Guard guard(mesh, frame, problem, certifier, certificates, team);
    const std::vector<double> kept = problem.positions;
    for (std::size_t f = 0; f < problem.free.size(); ++f)
      problem.positions[std::size_t(2 * problem.free[f])] += f == problem.free.size() / 2 ? 0.08 : 0.001;
    const std::vector<double> moved = problem.positions;
    guard.certify_moved();
    const std::int64_t lost = guard.lost();
    ASSERT_GT(lost, 0);
    Untangler::FailedStarts failed_starts;
    Untangler untangler(Untangler::FromHere{}, problem, *kernels, guard, team, failed_starts, Untangler::Depth());
    EXPECT_EQ(problem.positions, moved) << "it begins where the problem is";
    while (!untangler.done()) {
      untangler.step();
      guard.certify_moved();
      untangler.judge();
    }
    EXPECT_EQ(guard.lost(), 0);
    EXPECT_EQ(guard.uncertified(), 0);
    // Nodes that no lost cell is near are still where they had moved to.
    std::size_t where_they_were = 0;
    for (std::size_t i = 0; i < moved.size(); ++i) where_they_were += problem.positions[i] == moved[i] ? 1 : 0;
    EXPECT_GT(where_they_were, moved.size() / 3);
    EXPECT_NE(problem.positions, kept);
  });
}

/// In this mesh of linked rods, sweeps and Newton leave two cells that can be repaired. Untangling repairs them.
TEST(Untangle, RepairsWhatSweepsAndNewtonLeave) {
  const auto mesh = shared_case("linkrods_p2.msh");
  if (!mesh) GTEST_SKIP() << "NOT RUN: the shared cases are not there; set VARIMESH_CASES to their folder.";
  const auto result = optimise(*mesh, testing::for_energy());
  ASSERT_TRUE(result) << result.error().sentence;
  const auto untangled = std::ranges::count(result->history, Phase::Untangle, &Iteration::phase);
  EXPECT_GT(untangled, 0);
  std::vector<char> unrepairable(certify(*mesh).size(), 0);
  for (const UnrepairableGroup& group : result->unrepairable)
    for (const std::int32_t cell : group.cells) unrepairable[std::size_t(cell)] = 1;
  const std::vector<Certificate> certificates = certify(result->mesh);
  for (std::size_t cell = 0; cell < certificates.size(); ++cell)
    EXPECT_TRUE(unrepairable[cell] != 0 || certificates[cell].is_valid()) << "cell " << cell;
}

}  // namespace
}  // namespace varimesh
