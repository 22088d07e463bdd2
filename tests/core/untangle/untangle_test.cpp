// Patches that are mended, patches that cannot be, and what is kept of each.
#include "core/untangle/untangle.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <random>

#include "core/formats/formats.h"
#include "core/mesh/connectivity.h"
#include "core/optimise/optimiser.h"
#include "core/optimise/phases.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

/// A mesh whose free nodes have been moved, with all that untangling asks for.
class Patient {
 public:
  Patient(HighOrderMesh mesh, double push, int threads)
      : mesh_(std::move(mesh)), frame_(frame_of(mesh_)), certifier_(mesh_), team_(threads) {
    problem_ = build_problem(mesh_, fixed_nodes(mesh_), 0);
    problem_.positions = solver_positions(mesh_, frame_);
    set_straight_sided_targets(problem_);
    // One free node in twenty goes astray, in the file's coordinates, too.
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
  int untangle() {
    int steps = 0;
    team_.run([&] {
      Untangler untangler(problem_, *kernels_, *guard_, team_);
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
};

class UntangleShapes : public ::testing::TestWithParam<Filling> {
 protected:
  static HighOrderMesh mesh() {
    return testing::grid(GetParam(), {3, 3, 2}, 2, testing::bent(testing::is_plane(GetParam()) ? 2 : 3));
  }
};

TEST_P(UntangleShapes, MendsEveryCell) {
  Patient patient(mesh(), 0.15, 1);
  ASSERT_GT(patient.guard().uncertified(), 0);
  const int steps = patient.untangle();
  EXPECT_LT(steps, 60);
  EXPECT_EQ(patient.guard().uncertified(), 0);
}

TEST_P(UntangleShapes, LeavesFixedNodesAndTheRestOfTheMeshAlone) {
  Patient patient(mesh(), 0.15, 1);
  const std::vector<bool> fixed = fixed_nodes(patient.mesh());
  patient.untangle();
  const std::vector<double>& after = patient.guard().coordinates();
  for (std::size_t n = 0; n < fixed.size(); ++n)
    for (std::size_t k = 0; k < 3 && fixed[n]; ++k) EXPECT_EQ(after[3 * n + k], patient.mesh().coordinates[3 * n + k]);
  EXPECT_NE(after, patient.mesh().coordinates);
}

TEST_P(UntangleShapes, DoesNotDependOnTheNumberOfThreads) {
  Patient one(mesh(), 0.15, 1), four(mesh(), 0.15, 4);
  EXPECT_EQ(one.untangle(), four.untangle());
  EXPECT_EQ(one.guard().coordinates(), four.guard().coordinates());
}

INSTANTIATE_TEST_SUITE_P(Fillings, UntangleShapes, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return std::string(testing::name(info.param)); });

/// A cube's tetrahedra of which one boundary edge folds over itself: nothing can mend those that own it.
HighOrderMesh hopeless() {
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

TEST(Untangle, EndsWhereNothingCanBeMendedAndPutsEverythingBack) {
  Patient patient(hopeless(), 0, 1);
  const std::int64_t before = patient.guard().uncertified();
  ASSERT_GT(before, 0);
  const std::vector<double> positions = patient.problem().positions;
  EXPECT_LT(patient.untangle(), 100);
  EXPECT_EQ(patient.guard().uncertified(), before);
  EXPECT_EQ(patient.problem().positions, positions);
}

TEST(Untangle, KeepsUnrepairableCellsOutOfTheBarrier) {
  Patient patient(hopeless(), 0.15, 1);
  const std::vector<UnrepairableGroup> groups = diagnose(hopeless(), 1);
  ASSERT_FALSE(groups.empty());
  patient.guard().set_unrepairable(groups);
  ASSERT_GT(patient.guard().repairable(), 0);
  patient.untangle();
  EXPECT_EQ(patient.guard().repairable(), 0);
  EXPECT_GT(patient.guard().uncertified(), 0);
}

// ---------------------------------------------------------------------------------------------------------------------
// When it is tried
// ---------------------------------------------------------------------------------------------------------------------

/// Lets `count` iterations pass that bring nothing.
void stall(PhaseChooser& chooser, std::int64_t unrepaired, int count) {
  for (int i = 0; i < count; ++i) chooser.next(unrepaired, unrepaired, false);
}

TEST(PhaseChooser, UntanglesWhereSweepsAndNewtonHaveStalled) {
  PhaseChooser chooser(Options(), 5);
  EXPECT_EQ(chooser.phase(), Phase::Sweeps);
  stall(chooser, 5, 10);
  EXPECT_EQ(chooser.phase(), Phase::Newton);
  EXPECT_EQ(chooser.outlook(5), Outlook::AnotherMethod);
  stall(chooser, 5, 10);
  ASSERT_EQ(chooser.phase(), Phase::Untangle);
  chooser.untangling_from(5);
  stall(chooser, 5, 100);
  EXPECT_EQ(chooser.phase(), Phase::Untangle) << "it says itself when it has come to its end";
  chooser.next(5, 5, true);
  EXPECT_EQ(chooser.phase(), Phase::Newton);
  EXPECT_EQ(chooser.outlook(5), Outlook::Nothing) << "untangling brought nothing";
  stall(chooser, 5, 100);
  EXPECT_EQ(chooser.phase(), Phase::Newton);
}

TEST(PhaseChooser, UntanglesAgainOnlyAfterSuccess) {
  PhaseChooser chooser(Options(), 5);
  stall(chooser, 5, 20);
  chooser.untangling_from(5);
  chooser.next(3, 3, true);
  EXPECT_EQ(chooser.outlook(3), Outlook::AnotherMethod);
  stall(chooser, 3, 10);
  EXPECT_EQ(chooser.phase(), Phase::Untangle);
}

TEST(PhaseChooser, DoesNotUntangleWhatCannotBeRepaired) {
  PhaseChooser chooser(Options(), 5);
  EXPECT_EQ(chooser.outlook(0), Outlook::Nothing);
  chooser.next(0, 0, false);
  EXPECT_EQ(chooser.phase(), Phase::Newton);
  stall(chooser, 0, 50);
  EXPECT_EQ(chooser.phase(), Phase::Newton);
}

TEST(PhaseChooser, UntanglesBeforeNewtonWhereValidIsAllThatIsAskedFor) {
  Options options;
  options.until = Until::Valid;
  PhaseChooser chooser(options, 5);
  stall(chooser, 5, 10);
  EXPECT_EQ(chooser.phase(), Phase::Untangle);
  chooser.untangling_from(5);
  chooser.next(5, 5, true);
  EXPECT_EQ(chooser.phase(), Phase::Newton);
  EXPECT_EQ(chooser.outlook(5), Outlook::Patience);
}

// ---------------------------------------------------------------------------------------------------------------------
// Shared cases
// ---------------------------------------------------------------------------------------------------------------------

/// The shared case of that name; nothing where the cases are not there.
std::optional<HighOrderMesh> shared_case(const std::string& name) {
  const char* folder = std::getenv("VARIMESH_CASES");
  const auto path = std::filesystem::path(folder ? folder : VARIMESH_SOURCE_DIR "/../shared/cases") / "meshes" / name;
  if (!std::filesystem::exists(path)) return std::nullopt;
  auto file = formats::read_file(path.string());
  EXPECT_TRUE(file);
  return file ? std::optional(std::move(file->mesh)) : std::nullopt;
}

/// A boundary layer whose two tangled cells can only be mended with many others round them.
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

/// What sweeps and Newton leave of the links of rods: two cells that can be repaired, and are.
TEST(Untangle, MendsWhatSweepsAndNewtonLeave) {
  const auto mesh = shared_case("linkrods_p2.msh");
  if (!mesh) GTEST_SKIP() << "NOT RUN: the shared cases are not there; set VARIMESH_CASES to their folder.";
  const auto result = optimise(*mesh);
  ASSERT_TRUE(result) << result.error().sentence;
  const auto untangled = std::ranges::count(result->history, Phase::Untangle, &Iteration::phase);
  EXPECT_GT(untangled, 0);
  std::vector<char> named(certify(*mesh).size(), 0);
  for (const UnrepairableGroup& group : result->unrepairable)
    for (const std::int32_t cell : group.cells) named[std::size_t(cell)] = 1;
  const std::vector<Certificate> certificates = certify(result->mesh);
  for (std::size_t cell = 0; cell < certificates.size(); ++cell)
    EXPECT_TRUE(named[cell] != 0 || certificates[cell].is_valid()) << "cell " << cell;
}

}  // namespace
}  // namespace varimesh
