// Distances between the nodes of elements on a sphere, where they are known: | |x| − 1 |.
#include "core/slide/between_nodes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/geometry/analytic.h"
#include "core/reference/basis.h"

namespace varimesh::detail {
namespace {

constexpr int kOrder = 3;

/// Triangles on the unit sphere. Their nodes are the straight triangle's, moved onto the sphere.
struct OnSphere {
  std::shared_ptr<const geometry::SurfaceShape> shape = geometry::sphere({}, 1);
  std::vector<EntityElement> elements;
  std::vector<EntityNode> nodes;
  std::vector<double> coordinates;

  /// @param corners  (u, v) of the sphere
  void add(const std::array<Eigen::Vector2d, 3>& corners) {
    Eigen::Matrix3d x;
    for (int k = 0; k < 3; ++k) x.col(k) = shape->at(corners[std::size_t(k)][0], corners[std::size_t(k)][1]).x;
    const auto& lattice = reference::nodes(Shape::Triangle, kOrder, reference::NodeSet::Equispaced, 2);
    const Eigen::MatrixXd basis =
        reference::basis_values(Shape::Triangle, 1, reference::NodeSet::Equispaced, 2, lattice);
    EntityElement& element = elements.emplace_back(EntityElement{Shape::Triangle, {}, 0});
    for (Eigen::Index k = 0; k < basis.rows(); ++k) {
      const Eigen::Vector3d at = (x * basis.row(k).transpose()).normalized();
      const auto number = static_cast<std::int32_t>(nodes.size());
      element.nodes.push_back(number);
      nodes.push_back({number, true, {std::atan2(at[1], at[0]), std::asin(std::clamp(at[2], -1.0, 1.0))}, at});
      coordinates.insert(coordinates.end(), at.begin(), at.end());
    }
  }

  Distances distances(std::size_t first, std::size_t count, int threads = 1) const {
    const Team team(threads);
    return surface_distances(*shape, std::span(elements).subspan(first, count), kOrder, nodes, coordinates, team);
  }
  double found(std::size_t first, std::size_t count) const { return distances(first, count).largest; }

  /// Compares with what is expected: largest among the points where the distance may be measured.
  void expect_found(std::size_t first, std::size_t count) const {
    EXPECT_LE(found(first, count), expected(first, count) + 1e-13);
    EXPECT_GE(found(first, count), 0.99 * expected(first, count) - 1e-13);
  }

  double expected(std::size_t first, std::size_t count) const {
    const EntityTable& table = entity_table(Shape::Triangle, kOrder);
    double largest = 0;
    for (std::size_t e = first; e < first + count; ++e)
      for (const Eigen::MatrixXd* basis : {&table.between, &table.finer})
        for (Eigen::Index p = 0; p < basis->rows(); ++p) {
          Eigen::Vector3d x = Eigen::Vector3d::Zero();
          for (std::size_t k = 0; k < elements[e].nodes.size(); ++k)
            x += (*basis)(p, Eigen::Index(k)) * nodes[std::size_t(elements[e].nodes[k])].x;
          largest = std::max(largest, std::abs(x.norm() - 1));
        }
    return largest;
  }
};

constexpr double kPi = std::numbers::pi;

TEST(BetweenNodes, DoNotDependOnThePeriodInWhichANodeIs) {
  OnSphere mesh;
  mesh.add({Eigen::Vector2d(kPi - 0.2, 0.1), Eigen::Vector2d(kPi + 0.25, 0.2), Eigen::Vector2d(kPi, 0.5)});
  for (std::size_t k = 0; k < mesh.nodes.size(); ++k) mesh.nodes[k].at[0] += 2 * kPi * (static_cast<int>(k % 3) - 1);
  EXPECT_GT(mesh.expected(0, 1), 1e-5);
  mesh.expect_found(0, 1);
}

TEST(BetweenNodes, AreFoundIfANodeIsAtAPole) {
  OnSphere mesh;
  mesh.add({Eigen::Vector2d(0.3, kPi / 2), Eigen::Vector2d(0.2, 1.1), Eigen::Vector2d(1, 1.2)});
  mesh.expect_found(0, 1);
}

TEST(BetweenNodes, AreFoundRoundAWholeParallel) {
  OnSphere mesh;
  for (int k = 0; k < 2; ++k)  // each is half a period wide, and longer than the sphere is curved
    mesh.add(
        {Eigen::Vector2d(kPi * k, 0.3), Eigen::Vector2d(kPi * k + kPi / 2, 0.2), Eigen::Vector2d(kPi * k + kPi, 0.4)});
  mesh.expect_found(0, 2);
}

TEST(BetweenNodes, AreTheSameForOneElementAndForMany) {
  OnSphere mesh;
  for (int k = 0; k < 6; ++k)
    mesh.add({Eigen::Vector2d(k, 0.1), Eigen::Vector2d(k + 0.6, 0.2), Eigen::Vector2d(k + 0.3, 0.7)});
  double largest = 0;
  for (std::size_t e = 0; e < mesh.elements.size(); ++e) largest = std::max(largest, mesh.found(e, 1));
  EXPECT_EQ(mesh.found(0, mesh.elements.size()), largest);
}

TEST(BetweenNodes, DependNeitherOnTheThreadsNorOnTheOrderOfElements) {
  OnSphere mesh;
  for (int k = 0; k < 60; ++k) {  // from small ones to large ones, whose distances differ by three orders of magnitude
    const double size = 0.1 + 0.01 * k;
    mesh.add({Eigen::Vector2d(k, 0.1), Eigen::Vector2d(k + size, 0.2), Eigen::Vector2d(k + size / 2, 0.1 + size)});
  }
  const Distances one = mesh.distances(0, 60);
  EXPECT_EQ(one.elements, 60);
  mesh.expect_found(0, 60);
  for (const int threads : {2, 3, 16}) {
    const Distances many = mesh.distances(0, 60, threads);
    EXPECT_EQ(many.largest, one.largest) << threads;
    EXPECT_EQ(many.sum_of_squares, one.sum_of_squares) << threads;
  }
  std::ranges::reverse(mesh.elements);
  EXPECT_EQ(mesh.found(0, 60), one.largest);
}

}  // namespace
}  // namespace varimesh::detail
