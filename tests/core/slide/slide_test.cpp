#include "core/slide/slide.h"

#include <gtest/gtest.h>

#include <atomic>
#include <numbers>

#include "core/association/own_boundary.h"
#include "core/association/smooth_joints.h"
#include "core/geometry/analytic.h"
#include "core/geometry/closest_point.h"
#include "core/slide/on_file/slide_on_file.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/split_pipe.h"
#include "tests/core/support/surface_grid.h"

namespace varimesh {
namespace {

using testing::read_case;
using testing::surface_grid;
constexpr double kTurn = 2 * std::numbers::pi;

/// Moves a place in [0, 1] by a wave that is zero at the vertices of `count` elements, so that the nodes between them
/// crowd at the middle of each element.
double crowded(double s, double strength, int count) {
  return s + strength * std::sin(count * kTurn * s) / (count * kTurn);
}

geometry::Geometry torus() {
  geometry::Geometry result;
  result.surfaces.push_back({1, geometry::torus({}, 2, 0.7), {}});
  return result;
}

/// A torus on whose seams elements lie across, with uneven nodes.
HighOrderMesh torus_mesh(double strength, int columns = 8, int rows = 5) {
  return surface_grid(*torus().surfaces[0].shape, columns, rows, 3, 1, true, [=](double s, double t) {
    return std::array<double, 2>{kTurn * (crowded(s, strength, columns) + 0.03 + 0.02 * std::sin(kTurn * t)),
                                 kTurn * (crowded(t, strength, rows) + 0.05)};
  });
}

SlideReport slid(HighOrderMesh& mesh, const geometry::Geometry& geometry, SlideOn what, int threads = 1,
                 std::vector<bool> fixed = {}) {
  const Team team(threads);
  SlideReport report;
  fixed.resize(mesh.node_count(), false);
  team.run([&] {
    auto association = associate(mesh, geometry, team);
    ASSERT_TRUE(association) << association.error().sentence;
    ASSERT_TRUE(association->held.empty());
    report = slide(mesh, *association, what, fixed, team);
  });
  return report;
}

double off_torus(const HighOrderMesh& mesh) {
  double largest = 0;
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    const double* x = &mesh.coordinates[3 * node];
    largest = std::max(largest, std::abs(std::hypot(std::hypot(x[0], x[1]) - 2, x[2]) - 0.7));
  }
  return largest;
}

TEST(Slide, BringsTheBoundaryNearerAndKeepsNodesOnTheSurface) {
  HighOrderMesh mesh = torus_mesh(0.5);
  const SlideReport report = slid(mesh, torus(), SlideOn::All);
  EXPECT_GT(report.nodes, 0);
  EXPECT_LT(off_torus(mesh), 1e-13);
  EXPECT_LT(report.after.rms, 0.7 * report.before.rms);
  EXPECT_LE(report.after.largest, report.before.largest);
}

TEST(Slide, ConvergesWithOrderFourAtOrderThree) {
  double rms[2];
  for (int level = 0; level < 2; ++level) {
    HighOrderMesh mesh = torus_mesh(0.2, 8 << level, 5 << level);
    rms[level] = slid(mesh, torus(), SlideOn::All).after.rms;
  }
  EXPECT_GT(std::log2(rms[0] / rms[1]), 3.7);
}

TEST(Slide, HasTheSameBitsForAnyNumberOfThreads) {
  HighOrderMesh one = torus_mesh(0.5), three = one;
  slid(one, torus(), SlideOn::All, 1);
  slid(three, torus(), SlideOn::All, 3);
  EXPECT_EQ(one.coordinates, three.coordinates);
}

TEST(Slide, MovesNothingWithNone) {
  HighOrderMesh mesh = torus_mesh(0.5);
  const std::vector<double> before = mesh.coordinates;
  const SlideReport report = slid(mesh, torus(), SlideOn::None);
  EXPECT_EQ(mesh.coordinates, before);
  EXPECT_EQ(report.nodes, 0);
  EXPECT_GT(report.before.rms, 0);
  EXPECT_EQ(report.after.rms, report.before.rms);
}

TEST(Slide, KeepsFixedNodes) {
  HighOrderMesh mesh = torus_mesh(0.5);
  const std::vector<double> before = mesh.coordinates;
  std::vector<bool> fixed(mesh.node_count(), false);
  for (std::size_t node = 0; node < fixed.size(); node += 7) fixed[node] = true;
  slid(mesh, torus(), SlideOn::All, 1, fixed);
  for (std::size_t node = 0; node < fixed.size(); ++node)
    for (std::size_t k = 0; k < 3 && fixed[node]; ++k) EXPECT_EQ(mesh.coordinates[3 * node + k], before[3 * node + k]);
}

/// A pipe between two circles, on which nodes crowd.
TEST(Slide, EvensOutNodesOnCurvesAndOnlyWithAll) {
  geometry::Geometry pipe;
  geometry::Frame top;
  top.origin = {0, 0, 2};
  pipe.curves.push_back({1, geometry::circle({}, 1), {}, {0}});
  pipe.curves.push_back({2, geometry::circle(top, 1), {}, {0}});
  pipe.surfaces.push_back({1, geometry::cylinder({}, 1, 2), {0, 1}});
  const HighOrderMesh start = surface_grid(*pipe.surfaces[0].shape, 6, 3, 3, 1, false, [](double s, double t) {
    return std::array<double, 2>{kTurn * (s + 0.04 * std::sin(6 * kTurn * s) + 0.1 * t), 2 * crowded(t, 0.2, 3)};
  });
  for (const SlideOn what : {SlideOn::All, SlideOn::Surfaces}) {
    HighOrderMesh mesh = start;
    const SlideReport report = slid(mesh, pipe, what);
    EXPECT_EQ(report.curves, what == SlideOn::All ? 2 : 0);
    bool moved = false;
    for (std::size_t node = 0; node < mesh.node_count(); ++node) {
      const double* x = &mesh.coordinates[3 * node];
      const double z = start.coordinates[3 * node + 2];
      if (z != 0 && z != 2) continue;
      EXPECT_NEAR(x[2], z, 1e-15);
      EXPECT_NEAR(std::hypot(x[0], x[1]), 1, 1e-14);
      moved = moved || x[0] != start.coordinates[3 * node];
    }
    EXPECT_EQ(moved, what == SlideOn::All);
    EXPECT_LT(report.after.rms, report.before.rms);
  }
}

/// A torus on which the inner nodes of one element lie beyond its side.
HighOrderMesh folded_torus() {
  return surface_grid(*torus().surfaces[0].shape, 8, 5, 3, 1, true, [](double s, double t) {
    const double column = 8 * s, row = 5 * t;
    const bool inside = column > 3.1 && column < 3.9 && row > 2.1 && row < 2.9;
    return std::array<double, 2>{kTurn * (s + (inside ? 0.09 : 0)), kTurn * t};
  });
}

TEST(Slide, UnfoldsElements) {
  HighOrderMesh one = folded_torus(), all = torus_mesh(1.8);
  const SlideReport report = slid(one, torus(), SlideOn::All), of_all = slid(all, torus(), SlideOn::All);
  EXPECT_EQ(report.folded_before, 1);
  EXPECT_EQ(report.folded_after, 0);
  EXPECT_EQ(of_all.folded_before, 40);  // the wave is so strong that the nodes of every element change places
  EXPECT_EQ(of_all.folded_after, 0);
  EXPECT_LT(off_torus(all), 1e-13);
}

// All nodes of four elements are held, and two of them have changed places, so that three of the elements are folded at
// their common vertex.
TEST(Slide, IsNotDisturbedByAFoldBetweenHeldNodes) {
  std::vector<double> results[2];
  std::vector<bool> fixed, swapped;
  for (const bool folds : {false, true}) {
    fixed.clear(), swapped.clear();
    HighOrderMesh mesh = surface_grid(*torus().surfaces[0].shape, 8, 5, 3, 1, true, [&](double s, double t) {
      const auto is_at = [&](double column, double row) { return std::hypot(8 * s - column, 5 * t - row) < 1e-9; };
      fixed.push_back(std::abs(8 * s - 3) < 1.001 && std::abs(5 * t - 2) < 1.001);
      swapped.push_back(is_at(10. / 3, 2) || is_at(3, 7. / 3));
      if (folds && is_at(10. / 3, 2)) return std::array<double, 2>{kTurn * 3 / 8, kTurn * 7 / 15};
      if (folds && is_at(3, 7. / 3)) return std::array<double, 2>{kTurn * 10 / 24, kTurn * 2 / 5};
      return std::array<double, 2>{kTurn * crowded(s, 0.3, 8), kTurn * crowded(t, 0.3, 5)};
    });
    const SlideReport report = slid(mesh, torus(), SlideOn::All, 1, fixed);
    EXPECT_EQ(report.folded_before, folds ? 3 : 0);
    EXPECT_EQ(report.folded_after, report.folded_before);
    EXPECT_GT(report.nodes, 0);
    results[folds ? 1 : 0] = mesh.coordinates;
  }
  for (std::size_t node = 0; node < fixed.size(); ++node)
    for (std::size_t k = 0; k < 3 && !swapped[node]; ++k) EXPECT_EQ(results[0][3 * node + k], results[1][3 * node + k]);
}

// ===== Smooth joints =====

TEST(SlideOverJoints, LetsNodesCrossThem) {
  const HighOrderMesh start = testing::split_pipe_mesh(0.6);
  double rms[2];
  for (const bool joined : {false, true}) {
    HighOrderMesh mesh = start;
    const Team team(1);
    SlideReport report;
    team.run([&] {
      auto association = associate(mesh, testing::split_pipe(), team);
      ASSERT_TRUE(association) << association.error().sentence;
      if (joined) join_smoothly(mesh, *association, 0.1);
      report = slide(mesh, *association, SlideOn::All, std::vector<bool>(mesh.node_count(), false), team);
    });
    rms[joined] = report.after.rms;
    bool crossed = false;
    for (std::size_t node = 0; node < mesh.node_count(); ++node) {
      const double *x = &mesh.coordinates[3 * node], *old = &start.coordinates[3 * node];
      EXPECT_NEAR(std::hypot(x[0], x[1]), 1, 1e-12);
      EXPECT_TRUE((old[2] != 0 && old[2] != 2) || std::abs(x[2] - old[2]) < 1e-12);
      crossed = crossed || (std::abs(old[1]) < 1e-12 && std::abs(x[1]) > 1e-3);
    }
    EXPECT_EQ(crossed, joined);
  }
  EXPECT_LE(rms[1], 1.01 * rms[0]);
}

// ===== On the mesh's own boundary =====

SlideReport slid_on_boundary(HighOrderMesh& mesh, int threads = 1) {
  const Team team(threads);
  SlideReport report;
  team.run([&] {
    auto own = own_boundary(mesh, team);
    ASSERT_TRUE(own) << own.error().sentence;
    report = slide(own->faces, own->association, SlideOn::All, std::vector<bool>(mesh.node_count(), false), team);
    mesh.coordinates = own->faces.coordinates;
  });
  return report;
}

/// The largest distance between the elements of two meshes with the same elements: from points of the one, between its
/// nodes too, to the other as a whole.
double distance_between(const HighOrderMesh& from, const HighOrderMesh& to) {
  const Team team(1);
  double largest = 0;
  team.run([&] {
    const auto one = own_boundary(from, team), other = own_boundary(to, team);
    ASSERT_TRUE(one && other);
    for (std::size_t s = 0; s < one->association.surfaces.size(); ++s) {
      const geometry::SurfaceShape& shape = *one->association.geometry.surfaces[s].shape;
      for (double u = 0; u < shape.u_range().last; u += 4)
        for (int i = 0; i <= 5; ++i)
          for (int j = 0; j <= 5; ++j) {
            const double xi = -1 + 0.4 * i, eta = -1 + 0.4 * j;
            if (!shape.contains(u + xi, eta)) continue;
            double least = std::numeric_limits<double>::infinity();
            for (const geometry::Surface& surface : other->association.geometry.surfaces)
              least = std::min(least, surface.shape->pieces()->closest(shape.at(u + xi, eta).x).distance);
            largest = std::max(largest, least);
          }
    }
  });
  return largest;
}

/// How far the elements of a mesh lie from the torus.
double error_on_torus(const HighOrderMesh& mesh) {
  const Team team(1);
  double largest = 0;
  team.run([&] {
    auto association = associate(mesh, torus(), team);
    ASSERT_TRUE(association);
    HighOrderMesh same = mesh;
    largest =
        slide(same, *association, SlideOn::None, std::vector<bool>(mesh.node_count(), false), team).before.largest;
  });
  return largest;
}

TEST(SlideOnBoundary, StaysWithinTheErrorOfInterpolation) {
  for (const double strength : {0.3, 0.6}) {
    const HighOrderMesh start = torus_mesh(strength, 10, 6);
    HighOrderMesh mesh = start;
    const SlideReport report = slid_on_boundary(mesh);
    EXPECT_GT(report.nodes, 0);
    EXPECT_GT(report.farthest, 0.01);
    EXPECT_LE(distance_between(mesh, start), error_on_torus(start));
  }
}

TEST(SlideOnBoundary, UnfoldsElements) {
  HighOrderMesh mesh = read_case("geometry/bracket_p3.msh");
  const SlideReport report = slid_on_boundary(mesh);
  EXPECT_EQ(report.folded_before, 1);
  EXPECT_EQ(report.folded_after, 0);
}

TEST(SlideOnBoundary, KeepsPlanesAndStraightEdgesExactly) {
  HighOrderMesh mesh = read_case("sphere_p3.msh");
  const std::vector<double> before = mesh.coordinates;
  slid_on_boundary(mesh);
  for (std::size_t c = 0; c < before.size(); ++c)
    if (std::abs(before[c]) == 1) {
      EXPECT_NEAR(mesh.coordinates[c], before[c], 1e-13);
    }
}

TEST(SlideOnBoundary, UnfoldsMeshesOfOrderOne) {
  const HighOrderMesh start = testing::grid(testing::Filling::Hexahedra, {4, 4, 4}, 1);
  const auto node_at = [&](double x, double y, double z) {
    for (std::size_t node = 0; node < start.node_count(); ++node)
      if (std::abs(start.coordinates[3 * node] - x) + std::abs(start.coordinates[3 * node + 1] - y) +
              std::abs(start.coordinates[3 * node + 2] - z) <
          1e-12)
        return node;
    return start.node_count();
  };
  HighOrderMesh mesh = start;
  // A node in a face passes its neighbour.
  mesh.coordinates[3 * node_at(0.5, 0.5, 0)] += 0.3;
  const SlideReport report = slid_on_boundary(mesh);
  EXPECT_GT(report.folded_before, 0);
  EXPECT_EQ(report.folded_after, 0);
  for (std::size_t c = 0; c < mesh.coordinates.size(); ++c)
    if (start.coordinates[c] == 0 || start.coordinates[c] == 1) {
      EXPECT_NEAR(mesh.coordinates[c], start.coordinates[c], 1e-14);
    }
}

TEST(SlideOnBoundary, HasTheSameBitsForAnyNumberOfThreads) {
  HighOrderMesh one = read_case("sphere_p3.msh"), three = one;
  slid_on_boundary(one, 1);
  slid_on_boundary(three, 3);
  EXPECT_EQ(one.coordinates, three.coordinates);
}

TEST(SlideOnFile, TakesTheBoundaryWithoutAFileAndNotWithOne) {
  HighOrderMesh mesh = read_case("sphere_p3.msh");
  GeometryOptions options;
  options.slide_on = GeometrySource::Boundary;
  const auto sentences = slide_on_file(mesh, options);
  ASSERT_TRUE(sentences) << sentences.error().sentence;
  EXPECT_NE(sentences->front().find("7 surfaces, 12 curves and 8 vertices"), std::string::npos);
  options.file = "part.step";
  const auto both = slide_on_file(mesh, options);
  ASSERT_FALSE(both);
  EXPECT_EQ(both.error().kind, Error::Kind::BadOption);
}

TEST(SlideOnModel, LeavesTheMeshAsItCameIfItIsToStop) {
  const HighOrderMesh start = torus_mesh(1.8);
  std::atomic<int> looks = 0;
  GeometryOptions options;
  const auto slides = [&](int most) {
    HighOrderMesh mesh = start;
    const StopToken stop([&] { return ++looks > most; });
    options.stop = &stop;
    looks = 0;
    try {
      const auto slid = slide_on_model(mesh, options, torus());
      EXPECT_TRUE(slid) << slid.error().sentence;
      EXPECT_NE(mesh.coordinates, start.coordinates);
      return true;
    } catch (const Interrupted&) {
      EXPECT_EQ(mesh.coordinates, start.coordinates);
      return false;
    }
  };
  ASSERT_TRUE(slides(std::numeric_limits<int>::max()));
  const int all = looks;
  EXPECT_GT(all, 100);
  for (const int most : {0, all / 4, all / 2, 3 * all / 4, all - 1}) EXPECT_FALSE(slides(most)) << most;
  EXPECT_TRUE(slides(all));
  // Elements of one surface are a loop inside the loop over surfaces, and any thread may be the first to see the stop.
  options.threads = 3;
  ASSERT_TRUE(slides(std::numeric_limits<int>::max()));
  const int of_three = looks;
  for (int part = 0; part < 20; ++part) EXPECT_FALSE(slides(part * of_three / 21)) << part;
}

}  // namespace
}  // namespace varimesh
