// Low cells of a mesh are raised: no certificate is lost, fixed nodes stay bit for bit, an interrupt leaves the mesh
// whole.
#include "core/solvers/maxmin/raise.h"

#include <gtest/gtest.h>

#include <atomic>

#include "core/base/index.h"
#include "core/mesh/connectivity.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

struct Raised {
  HighOrderMesh mesh;
  std::vector<Certificate> before, after;
  RaiseOutcome outcome;
};

Raised raised(HighOrderMesh mesh, double aim, int threads = 1, const StopToken* stop = nullptr,
              std::vector<char> hopeless = {}) {
  Raised result;
  Team team(threads);
  const Certifier certifier(mesh);
  std::vector<Certificate> certificates(certifier.cells());
  team.run([&] { certifier.certify(mesh.coordinates, certificates, team); });
  result.before = certificates;
  hopeless.resize(certificates.size(), 0);
  const std::vector<bool> fixed = fixed_nodes(mesh);
  team.set_stop(stop);
  HighOrderMesh moved = mesh;
  const RaiseTask task{mesh, fixed, hopeless, certifier, aim};
  team.run([&] { result.outcome = raise_low_cells(task, moved.coordinates, certificates, team); });
  result.after = certificates;
  result.mesh = std::move(moved);
  return result;
}

std::ptrdiff_t invalid(const std::vector<Certificate>& certificates) {
  return std::ranges::count_if(certificates, [](const Certificate& each) { return !each.is_valid(); });
}

TEST(RaiseLowCells, MakesCellsValidAndLosesNoCertificate) {
  const HighOrderMesh mesh = testing::read_case("sphere_p3.msh");
  const Raised result = raised(mesh, 0);
  ASSERT_EQ(invalid(result.before), 11);
  EXPECT_LE(invalid(result.after), 1);  // without an energy before it
  EXPECT_EQ(std::ptrdiff_t(result.outcome.made_valid.size()), 11 - invalid(result.after));
  EXPECT_FALSE(result.outcome.interrupted);
  for (std::size_t c = 0; c < result.before.size(); ++c)
    if (result.before[c].is_valid()) {
      EXPECT_TRUE(result.after[c].is_valid()) << c;
    }
  // The certificates are those of the mesh.
  const std::vector<Certificate> again = certify(result.mesh);
  EXPECT_EQ(invalid(again), invalid(result.after));
  const std::vector<bool> fixed = fixed_nodes(mesh);
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    for (std::size_t c = 0; fixed[n] && c < 3; ++c)
      EXPECT_EQ(result.mesh.coordinates[3 * n + c], mesh.coordinates[3 * n + c]);
}

TEST(RaiseLowCells, LooksCloserIfAJacobianIsNegativeBetweenTheSamples) {
  // 43 tetrahedra of order 2 around one with a fixed face that turns by more than 90°: part of what VariMesh once made
  // of hoipc__microstructure_P2 (zfergus/high-order-ipc-data, Apache-2.0).
  const HighOrderMesh mesh = testing::read_case("../core/solvers/maxmin/bent_face_p2.msh");
  const Raised result = raised(mesh, 0);
  ASSERT_EQ(invalid(result.before), 1);
  EXPECT_EQ(invalid(result.after), 0);
  EXPECT_EQ(result.outcome.made_valid, std::vector<std::int64_t>{3987});
  EXPECT_GT(result.outcome.patches, 1);
}

TEST(RaiseLowCells, RaisesValidCellsToTheAim) {
  const HighOrderMesh mesh = testing::read_case("solid_ball_p3.msh");
  CertificateOptions sharp;
  sharp.gap = 0.001;
  const double before = summarise(certify(mesh, sharp)).min_scaled_jacobian_lower_bound;
  const Raised result = raised(mesh, before + 0.05);
  ASSERT_EQ(invalid(result.before), 0);
  EXPECT_EQ(invalid(result.after), 0);
  EXPECT_FALSE(result.outcome.raised.empty());
  EXPECT_GT(summarise(certify(result.mesh, sharp)).min_scaled_jacobian_lower_bound, before + 0.04);
}

TEST(RaiseLowCells, TriesAgainOnlyWhatHasChanged) {
  const HighOrderMesh mesh = testing::read_case("sphere_p3.msh");
  const Certifier certifier(mesh);
  std::vector<Certificate> certificates(certifier.cells());
  std::vector<bool> fixed(mesh.node_count(), true);  // so every try is in vain
  const std::vector<char> hopeless(certificates.size(), 0);
  const RaiseTask task{mesh, fixed, hopeless, certifier, 0};
  std::vector<double> coordinates = mesh.coordinates;
  RaiseMemory memory;
  const Team team(1);
  team.run([&] {
    certifier.certify(coordinates, certificates, team);
    raise_low_cells(task, coordinates, certificates, team, &memory);
    EXPECT_EQ(std::ranges::count(memory.tried, 1), invalid(certificates));
    forget_changed_cells(task, coordinates, certificates, team, memory);
    EXPECT_EQ(memory.looks, 0);
    EXPECT_EQ(std::ranges::count(memory.tried, 1), invalid(certificates));

    fixed = fixed_nodes(mesh);
    EXPECT_EQ(raise_low_cells(task, coordinates, certificates, team, &memory).patches, 0);
    const auto cell = at(std::ranges::find(memory.tried, 1) - memory.tried.begin());
    coordinates[3 * at(Cells(mesh, 3).nodes(cell).front())] += 0.01;
    certifier.certify(coordinates, certificates, team);
    forget_changed_cells(task, coordinates, certificates, team, memory);
    EXPECT_EQ(memory.tried[cell], 0);
    EXPECT_GT(raise_low_cells(task, coordinates, certificates, team, &memory).patches, 0);
  });
}

TEST(RaiseLowCells, GoesOnWhereTheLastCallEnded) {
  const HighOrderMesh mesh = testing::read_case("sphere_p3.msh");
  const Raised whole = raised(mesh, 0);
  const Certifier certifier(mesh);
  std::vector<Certificate> certificates(certifier.cells());
  const std::vector<bool> fixed = fixed_nodes(mesh);
  const std::vector<char> hopeless(certificates.size(), 0);
  std::vector<double> coordinates = mesh.coordinates;
  RaiseMemory memory;
  int calls = 0;
  const Team team(1);
  team.run([&] {
    certifier.certify(coordinates, certificates, team);
    for (bool finished = false; !finished; ++calls)
      finished =
          raise_low_cells({mesh, fixed, hopeless, certifier, 0}, coordinates, certificates, team, &memory, 1).finished;
  });
  EXPECT_GE(calls, 3);                  // each ends after the first cell
  EXPECT_LE(invalid(certificates), 2);  // the order of the cells is another, since each call sorts what is left
  EXPECT_GE(invalid(certificates), invalid(whole.after));
}

TEST(RaiseLowCells, IsTheSameForAnyNumberOfThreads) {
  const HighOrderMesh mesh = testing::read_case("sphere_p3.msh");
  EXPECT_EQ(raised(mesh, 0.05).mesh.coordinates, raised(mesh, 0.05, 3).mesh.coordinates);
}

TEST(RaiseLowCells, LeavesHopelessAndGoodCells) {
  const HighOrderMesh mesh = testing::read_case("sphere_p3.msh");
  const std::vector<char> all(raised(mesh, 0).before.size(), 1);
  const Raised none = raised(mesh, 0, 1, nullptr, all);
  EXPECT_EQ(none.mesh.coordinates, mesh.coordinates);
  EXPECT_TRUE(none.outcome.made_valid.empty());
  const HighOrderMesh good = testing::grid(testing::Filling::Tetrahedra, {2, 2, 2}, 3);
  EXPECT_EQ(raised(good, 0.1).mesh.coordinates, good.coordinates);
}

TEST(RaiseLowCells, KeepsWhatIsWholeIfItIsInterrupted) {
  const HighOrderMesh mesh = testing::read_case("sphere_p3.msh");
  for (const int looks : {0, 1, 10, 100, 300, 1000}) {
    std::atomic<int> left = looks;
    const StopToken stop([&] { return left-- <= 0; });
    const Raised result = raised(mesh, 0, 1, &stop);
    const std::vector<Certificate> again = certify(result.mesh);
    for (std::size_t c = 0; c < again.size(); ++c) EXPECT_EQ(again[c].is_valid(), result.after[c].is_valid()) << looks;
    EXPECT_LE(invalid(result.after), invalid(result.before));
  }
}

}  // namespace
}  // namespace varimesh
