#include "core/slide/distance/boundary_distances.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/geometry/analytic.h"
#include "core/reference/basis.h"
#include "core/slide/distance/slide_and_measure.h"
#include "tests/core/support/split_pipe.h"
#include "tests/core/support/surface_grid.h"

namespace varimesh {
namespace {

using testing::split_pipe;
using testing::split_pipe_mesh;
using testing::surface_grid;
constexpr double kTurn = 2 * std::numbers::pi;

geometry::Geometry torus() {
  geometry::Geometry result;
  result.surfaces.push_back({7, geometry::torus({}, 2, 0.7), {}, "Ring"});
  return result;
}

/// Elements across both seams, whose nodes crowd.
HighOrderMesh torus_mesh() {
  return surface_grid(*torus().surfaces[0].shape, 8, 5, 3, 1, true, [](double s, double t) {
    return std::array<double, 2>{kTurn * (s + 0.5 * std::sin(8 * kTurn * s) / (8 * kTurn) + 0.03),
                                 kTurn * (t + 0.5 * std::sin(5 * kTurn * t) / (5 * kTurn) + 0.05)};
  });
}

/// Slides, and measures before and after.
std::pair<SlideReport, BoundaryDistances> slid_and_measured(HighOrderMesh& mesh, const geometry::Geometry& geometry,
                                                            double smooth_angle, int threads = 1) {
  const HighOrderMesh start = mesh;
  GeometryOptions options;
  options.smooth_angle = smooth_angle;
  options.threads = threads;
  const auto slid = slide_on_model(mesh, options, geometry);
  EXPECT_TRUE(slid) << slid.error().sentence;
  const Team team(threads);
  Expected<BoundaryDistances> distances;
  team.run([&] { distances = boundary_distances(start, mesh.coordinates, geometry, smooth_angle, team); });
  EXPECT_TRUE(distances) << distances.error().sentence;
  return {slid->report, *distances};
}

/// The largest distance of a dense lattice of the element to the torus, by its formula.
double off_torus(const HighOrderMesh& mesh, std::size_t element) {
  const ElementBlock& block = mesh.blocks[0];
  const auto stride = block.nodes.size() / block.size();
  const auto values = reference::basis_values(block.shape, mesh.order, reference::NodeSet::Equispaced, 3,
                                              reference::uniform_lattice(block.shape, 10 * mesh.order));
  double largest = 0;
  for (Eigen::Index p = 0; p < values.rows(); ++p) {
    Eigen::Vector3d x = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < stride; ++k)
      x += values(p, static_cast<Eigen::Index>(k)) *
           Eigen::Map<const Eigen::Vector3d>(
               &mesh.coordinates[3 * static_cast<std::size_t>(block.nodes[element * stride + k])]);
    largest = std::max(largest, std::abs(std::hypot(std::hypot(x[0], x[1]) - 2, x[2]) - 0.7));
  }
  return largest;
}

TEST(BoundaryDistances, AreThoseOfTheFormulaForEachElement) {
  const HighOrderMesh start = torus_mesh();
  HighOrderMesh mesh = start;
  const auto [report, distances] = slid_and_measured(mesh, torus(), 0);
  ASSERT_EQ(distances.elements, start.blocks[0].numbers);
  for (std::size_t e = 0; e < distances.elements.size(); ++e) {
    EXPECT_NEAR(distances.before[e], off_torus(start, e), 0.05 * off_torus(start, e));
    EXPECT_NEAR(distances.after[e], off_torus(mesh, e), 0.05 * off_torus(mesh, e));
  }
  ASSERT_EQ(distances.surfaces.size(), 1U);
  EXPECT_EQ(distances.surfaces[0].tags, std::vector<int>{1});
  EXPECT_EQ(distances.surfaces[0].text(), "surface 7 'Ring'");
  EXPECT_EQ(distances.sentences().front().substr(0, 66),
            "The boundary is farthest from the geometry on surface 7 'Ring' (0.");
}

TEST(BoundaryDistances, AddUpToTheReportOfSliding) {
  HighOrderMesh mesh = torus_mesh();
  const auto [report, distances] = slid_and_measured(mesh, torus(), 0);
  ASSERT_GT(report.nodes, 0);
  const SurfaceDistance& ring = distances.surfaces.at(0);
  EXPECT_NEAR(ring.before.largest, report.before.largest, 1e-12);
  EXPECT_NEAR(ring.before.rms, report.before.rms, 1e-12);
  EXPECT_NEAR(ring.after.largest, report.after.largest, 1e-12);
  EXPECT_NEAR(ring.after.rms, report.after.rms, 1e-12);
  EXPECT_EQ(ring.folded_before, report.folded_before);
  EXPECT_EQ(ring.folded_after, report.folded_after);
}

TEST(BoundaryDistances, MeasureElementsThatCrossedAJointOnWhatItJoins) {
  HighOrderMesh mesh = split_pipe_mesh(0.05);
  const HighOrderMesh start = mesh;
  const auto [report, distances] = slid_and_measured(mesh, split_pipe(), 5);
  ASSERT_GT(report.nodes, 0);
  ASSERT_EQ(distances.surfaces.size(), 2U) << "each half has its own row";
  double largest = 0;
  for (const SurfaceDistance& half : distances.surfaces) largest = std::max(largest, half.after.largest);
  EXPECT_NEAR(largest, report.after.largest, 1e-12);
  EXPECT_LE(distances.surfaces[1].after.largest, distances.surfaces[0].after.largest);
}

TEST(BoundaryDistances, HaveTheSameBitsForAnyNumberOfThreads) {
  HighOrderMesh one = split_pipe_mesh(0.05), three = one;
  const auto [first, alone] = slid_and_measured(one, split_pipe(), 0, 1);
  const auto [second, together] = slid_and_measured(three, split_pipe(), 0, 3);
  EXPECT_EQ(alone.before, together.before);
  EXPECT_EQ(alone.after, together.after);
  EXPECT_EQ(alone.surface_of_element, together.surface_of_element);
}

TEST(SlideAndMeasure, SlidesToTheSameBitsAndSaysWhereTheBoundaryIsFarthest) {
  HighOrderMesh one = torus_mesh(), other = one;
  const auto slid = slide_on_model(one, {}, torus());
  const auto measured = slide_and_measure(other, {}, torus());
  ASSERT_TRUE(slid && measured);
  EXPECT_EQ(one.coordinates, other.coordinates);
  ASSERT_EQ(measured->slid.sentences.size(), slid->sentences.size() + 1);
  EXPECT_NE(measured->slid.sentences.back().find("farthest from the geometry on surface 7 'Ring'"), std::string::npos);
  ASSERT_TRUE(measured->distances);
  EXPECT_NEAR(measured->distances->surfaces[0].before.largest, slid->report.before.largest, 1e-12);
}

TEST(SlideAndMeasure, MeasuresTheSameBeforeAndAfterIfNothingSlides) {
  HighOrderMesh mesh = torus_mesh();
  GeometryOptions options;
  options.slide = SlideOn::None;
  const auto measured = slide_and_measure(mesh, options, torus());
  ASSERT_TRUE(measured && measured->distances);
  EXPECT_EQ(measured->distances->after, measured->distances->before);
  EXPECT_EQ(measured->distances->surfaces[0].after.rms, measured->distances->surfaces[0].before.rms);
}

}  // namespace
}  // namespace varimesh
