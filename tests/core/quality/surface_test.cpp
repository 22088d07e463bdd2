// Surfaces in space: each cell is judged along its mean normal, and a plane surface like a mesh in the plane.
#include "core/quality/surface.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <set>

#include "core/mesh/check.h"
#include "core/mesh/connectivity.h"
#include "core/optimise/marks/marks.h"
#include "core/reference/basis.h"
#include "core/reference/quadrature.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/turned.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::Place;

constexpr auto kNodes = reference::NodeSet::Equispaced;

/// A patch of a sphere of radius 2, with curved triangles and quadrilaterals.
HighOrderMesh sphere_patch(int order, Filling filling = Filling::MixedPlane) {
  HighOrderMesh mesh = testing::grid(filling, {4, 3, 0}, order);
  testing::move_nodes(mesh, [](Place at) {
    const Eigen::Vector3d x = 2 * Eigen::Vector3d(1.2 * at[0] - 0.6, 1.5 * at[1] - 0.6, 1).normalized();
    return Place{x[0], x[1], x[2]};
  });
  return mesh;
}

/// Moves the first node of an inner edge of a cell far along the surface, so that cells are folded there.
HighOrderMesh folded_patch(int order) {
  HighOrderMesh mesh = sphere_patch(order);
  const std::vector<bool> fixed = fixed_nodes(mesh);
  const Cells cells(mesh, 2);
  const auto nodes = cells.nodes(7);
  for (std::size_t n = cells.shape(7) == Shape::Triangle ? 3 : 4; n < nodes.size(); ++n) {
    if (fixed[static_cast<std::size_t>(nodes[n])]) continue;
    Eigen::Map<Eigen::Vector3d> x(mesh.coordinates.data() + 3 * nodes[n]);
    x = 2 * (x + Eigen::Vector3d(0.7, 0.4, 0)).normalized().eval();
    break;
  }
  return mesh;
}

/// n · (x_ξ × x_η) and x of one cell at the points of a lattice, one determinant at a time.
struct Sampled {
  std::vector<double> jacobian;
  std::vector<Eigen::Vector3d> place;

  double low() const { return std::ranges::min(jacobian); }
  double ratio() const { return low() / std::ranges::max(jacobian); }
  double distance_to(const Place& other) const {
    double least = 1e300;
    for (const Eigen::Vector3d& x : place)
      least = std::min(least, (x - Eigen::Vector3d(other[0], other[1], other[2])).norm());
    return least;
  }
};

Sampled sampled(const HighOrderMesh& mesh, std::size_t cell, int intervals) {
  const Cells cells(mesh, 2);
  const Shape shape = cells.shape(cell);
  const auto nodes = cells.nodes(cell);
  const auto normals_at = [&](const reference::Points& points) {
    const auto gradients = reference::basis_gradients(shape, mesh.order, kNodes, 2, points);
    std::vector<Eigen::Vector3d> normals;
    for (Eigen::Index p = 0; p < points.rows(); ++p) {
      Eigen::Vector3d u = Eigen::Vector3d::Zero(), v = u;
      for (std::size_t n = 0; n < nodes.size(); ++n) {
        const Eigen::Vector3d x = Eigen::Map<const Eigen::Vector3d>(mesh.coordinates.data() + 3 * nodes[n]);
        u += gradients[0](p, static_cast<Eigen::Index>(n)) * x;
        v += gradients[1](p, static_cast<Eigen::Index>(n)) * x;
      }
      normals.push_back(u.cross(v));
    }
    return normals;
  };
  const reference::Quadrature rule = reference::quadrature(shape, mesh.order, 2 * mesh.order);
  const std::vector<Eigen::Vector3d> at_rule = normals_at(rule.points);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (std::size_t q = 0; q < at_rule.size(); ++q) mean += rule.weights[static_cast<Eigen::Index>(q)] * at_rule[q];
  const reference::Points lattice = reference::uniform_lattice(shape, intervals);
  const Eigen::MatrixXd values = reference::basis_values(shape, mesh.order, kNodes, 2, lattice);
  Sampled result;
  for (const Eigen::Vector3d& normal : normals_at(lattice)) result.jacobian.push_back(mean.normalized().dot(normal));
  for (Eigen::Index p = 0; p < values.rows(); ++p) {
    Eigen::Vector3d x = Eigen::Vector3d::Zero();
    for (std::size_t n = 0; n < nodes.size(); ++n)
      x += values(p, static_cast<Eigen::Index>(n)) *
           Eigen::Map<const Eigen::Vector3d>(mesh.coordinates.data() + 3 * nodes[n]);
    result.place.push_back(x);
  }
  return result;
}

/// The mesh turned out of its plane, and moved.
HighOrderMesh tilted(HighOrderMesh mesh) {
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(2.5, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  testing::move_nodes(mesh, [&](Place at) {
    const Eigen::Vector3d x = turn * Eigen::Vector3d(at[0], at[1], at[2]) + Eigen::Vector3d(3, -1, 2);
    return Place{x[0], x[1], x[2]};
  });
  return mesh;
}

class QualityOfSurface : public ::testing::TestWithParam<int> {};

INSTANTIATE_TEST_SUITE_P(Orders, QualityOfSurface, ::testing::Values(2, 3, 4),
                         [](const auto& order) { return std::to_string(order.param); });

TEST_P(QualityOfSurface, IsMeasuredAlongTheMeanNormal) {
  const HighOrderMesh mesh = sphere_patch(GetParam());
  ASSERT_TRUE(check_judgeable(mesh));
  const QualityReport report = quality(mesh);
  const auto cells = static_cast<std::int64_t>(mesh.element_count(2));
  EXPECT_TRUE(report.is_surface);
  EXPECT_EQ(report.certified.valid, cells);
  EXPECT_EQ(report.invalid_elements, 0);
  EXPECT_FALSE(report.accuracy);
  const std::vector<double> js = cell_quality(mesh, 9).scaled_jacobian;
  double least = 1;
  for (std::size_t cell = 0; cell < js.size(); ++cell) {
    EXPECT_NEAR(js[cell], sampled(mesh, cell, 9).ratio(), 1e-12) << "cell " << cell;
    least = std::min(least, sampled(mesh, cell, report.lattice_intervals).ratio());
  }
  EXPECT_NEAR(report.min_scaled_jacobian, least, 1e-12);
  EXPECT_LE(report.certified.min_scaled_jacobian_lower_bound, least);
  EXPECT_NEAR(report.certified.min_scaled_jacobian_lower_bound, least, 0.01);
}

TEST_P(QualityOfSurface, NamesFoldedElementsAndTheirPlaces) {
  const HighOrderMesh mesh = folded_patch(GetParam());
  const QualityReport report = quality(mesh);
  const Cells cells(mesh, 2);
  std::map<std::int64_t, std::size_t> folded;
  for (std::size_t cell = 0; cell < cells.count(); ++cell)
    if (sampled(mesh, cell, report.lattice_intervals).low() <= 0) folded[cells.number(cell)] = cell;
  ASSERT_FALSE(folded.empty());
  ASSERT_LT(folded.size(), cells.count() / 2);
  ASSERT_EQ(report.invalid.size(), folded.size());
  for (const InvalidElement& element : report.invalid) {
    ASSERT_TRUE(folded.contains(element.number));
    const Sampled samples = sampled(mesh, folded[element.number], report.lattice_intervals);
    EXPECT_NEAR(element.scaled_jacobian, samples.ratio(), 1e-11);
    EXPECT_LT(samples.distance_to(element.place), 1e-12) << "the place is a sample, in space";
  }
  ASSERT_EQ(report.uncertified.size(), folded.size());
  for (const UncertifiedElement& element : report.uncertified) {
    ASSERT_TRUE(folded.contains(element.number));
    EXPECT_EQ(element.answer, Certificate::Answer::Invalid);
    EXPECT_LT(sampled(mesh, folded[element.number], 60).distance_to(element.place), 0.05) << "it is on the element";
  }
}

TEST_P(QualityOfSurface, DoesNotDependOnTheSenseOfNumberingOrOnThreads) {
  const HighOrderMesh mesh = folded_patch(GetParam());
  const HighOrderMesh other = testing::turned(mesh, testing::every_third_cell);
  const std::vector<double> js = cell_quality(mesh, 0, 1).scaled_jacobian;
  EXPECT_EQ(cell_quality(mesh, 0, 2).scaled_jacobian, js);
  const QualityReport report = quality(mesh), of_other = quality(other);
  EXPECT_TRUE(of_other.clockwise.empty());
  EXPECT_EQ(of_other.certified.invalid, report.certified.invalid);
  EXPECT_NEAR(of_other.min_scaled_jacobian, report.min_scaled_jacobian, 1e-12);
  EXPECT_NEAR(of_other.mean_scaled_jacobian, report.mean_scaled_jacobian, 1e-12);
}

TEST(QualityOfSurface, MarksTheCellsWithoutALossOfAccuracy) {
  const HighOrderMesh mesh = folded_patch(3);
  const CellMarks marks(mesh, {}, 1);
  EXPECT_EQ(std::ranges::count(marks.certified(), -1), quality(mesh).certified.invalid);
  for (const formats::CellField& field : marks.fields()) EXPECT_NE(std::string(field.name), "accuracy_loss");
}

TEST(QualityOfSurface, InATiltedPlaneIsThatInThePlane) {
  const HighOrderMesh flat = testing::read_case("nine_triangles.msh"), surface = tilted(flat);
  const QualityReport expected = quality(flat), report = quality(surface);
  EXPECT_FALSE(expected.is_surface);
  EXPECT_TRUE(report.is_surface);
  EXPECT_NEAR(report.min_scaled_jacobian, expected.min_scaled_jacobian, 1e-12);
  EXPECT_NEAR(report.mean_scaled_jacobian, expected.mean_scaled_jacobian, 1e-12);
  EXPECT_EQ(report.certified.valid, expected.certified.valid);
  EXPECT_EQ(report.certified.invalid, expected.certified.invalid);
  ASSERT_TRUE(report.accuracy);
  EXPECT_NEAR(report.accuracy->loss, expected.accuracy->loss, 1e-9 * expected.accuracy->loss);
  ASSERT_EQ(report.invalid.size(), expected.invalid.size());
  for (std::size_t i = 0; i < report.invalid.size(); ++i)
    EXPECT_EQ(report.invalid[i].number, expected.invalid[i].number);
}

TEST(QualityOfSurface, InATiltedPlaneAnElementThatIsInvertedAsAWholeIsNamed) {
  HighOrderMesh mesh = testing::grid(Filling::Triangles, {1, 1, 0}, 1);
  const auto names = [](const QualityReport& report) {
    std::set<std::int64_t> numbers;
    for (const InvalidElement& element : report.invalid) numbers.insert(element.number);
    return numbers;
  };
  // Each vertex belongs to one triangle only, or to both; one that belongs to one is moved across the common edge.
  const Cells cells(mesh, 2);
  for (const std::int32_t node : cells.nodes(1))
    if (std::ranges::count(cells.nodes(0), node) == 0)
      for (std::size_t c = 0; c < 2; ++c) {
        double& x = mesh.coordinates[3 * static_cast<std::size_t>(node) + c];
        x += 0.7 * (0.5 - x) / 0.5;
      }
  const QualityReport flat = quality(mesh), report = quality(tilted(mesh));
  EXPECT_EQ(names(flat), std::set<std::int64_t>{cells.number(1)});
  EXPECT_EQ(names(report), names(flat));
  EXPECT_EQ(report.certified.invalid, 1);
}

}  // namespace
}  // namespace varimesh
