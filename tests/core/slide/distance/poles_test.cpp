// Spheres whose poles are anywhere in the elements: printed distances against the formula | |x| − R |.
#include <gtest/gtest.h>

#include <map>

#include "core/geometry/analytic.h"
#include "core/reference/basis.h"
#include "core/slide/distance/slide_and_measure.h"

namespace varimesh {
namespace {

constexpr double kRadius = 1.5;

/// The six faces of a cube of n × n quadrilaterals each, of order 1, moved onto the sphere and turned.
HighOrderMesh cubed_sphere(int n, const Eigen::Matrix3d& turn) {
  HighOrderMesh mesh;
  mesh.dimension = 2;
  mesh.order = 1;
  ElementBlock block;
  block.shape = Shape::Quadrilateral;
  block.entity = 1;
  std::map<std::array<int, 3>, std::int32_t> numbers;
  const auto node = [&](int axis, int side, int i, int j) {
    std::array<int, 3> at{};
    const auto a = static_cast<std::size_t>(axis);
    at[a] = side * n;
    at[(a + 1) % 3] = side > 0 ? i : j;
    at[(a + 2) % 3] = side > 0 ? j : i;
    const auto [number, is_new] = numbers.try_emplace(at, static_cast<std::int32_t>(mesh.node_numbers.size()));
    if (is_new) {
      // Equal angles between the nodes.
      Eigen::Vector3d x;
      for (std::size_t k = 0; k < 3; ++k) x[Eigen::Index(k)] = std::tan(0.785398163397448 * (2.0 * at[k] / n - 1));
      x = kRadius * (turn * x).normalized();
      mesh.coordinates.insert(mesh.coordinates.end(), x.data(), x.data() + 3);
      mesh.node_numbers.push_back(number->second + 1);
    }
    return number->second;
  };
  for (int axis = 0; axis < 3; ++axis)
    for (const int side : {0, 1})
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          block.numbers.push_back(static_cast<std::int64_t>(block.numbers.size()) + 1);
          for (const auto& [a, b] :
               {std::pair(i, j), std::pair(i + 1, j), std::pair(i + 1, j + 1), std::pair(i, j + 1)})
            block.nodes.push_back(node(axis, side, a, b));
        }
  mesh.blocks.push_back(std::move(block));
  mesh.node_blocks = {{-1, 0, 0, static_cast<std::int32_t>(mesh.node_count())}};
  return mesh;
}

/// By the formula, at (intervals + 1)² points of each element. In the rms, each stands for what is nearest to it.
BoundaryDistance sampled(const HighOrderMesh& mesh, int intervals) {
  const ElementBlock& block = mesh.blocks[0];
  const auto values = reference::basis_values(block.shape, mesh.order, reference::NodeSet::Equispaced, 3,
                                              reference::uniform_lattice(block.shape, intervals));
  const auto stride = block.nodes.size() / block.size();
  const auto weight = [&](Eigen::Index p) {
    const auto along = [&](Eigen::Index k) { return k == 0 || k == intervals ? 0.5 : 1; };
    return along(p / (intervals + 1)) * along(p % (intervals + 1)) / (intervals * intervals);
  };
  BoundaryDistance result;
  for (std::size_t e = 0; e < block.size(); ++e)
    for (Eigen::Index p = 0; p < values.rows(); ++p) {
      Eigen::Vector3d x = Eigen::Vector3d::Zero();
      for (std::size_t k = 0; k < stride; ++k)
        x += values(p, Eigen::Index(k)) *
             Eigen::Map<const Eigen::Vector3d>(&mesh.coordinates[3 * std::size_t(block.nodes[e * stride + k])]);
      const double off = std::abs(x.norm() - kRadius);
      result.largest = std::max(result.largest, off);
      result.rms += weight(p) * off * off / static_cast<double>(block.size());
    }
  result.rms = std::sqrt(result.rms);
  return result;
}

/// Up to what is between the points at which the distance is measured.
void expect_true(const BoundaryDistance& printed, const HighOrderMesh& mesh) {
  const BoundaryDistance dense = sampled(mesh, 8 * mesh.order + 4);
  EXPECT_NEAR(printed.rms, dense.rms, 0.05 * dense.rms + 1e-14);
  EXPECT_NEAR(printed.largest, dense.largest, 0.05 * dense.largest + 1e-14);
}

TEST(DistancesAtPoles, AreTrueOnFiftyCubedSpheresAndDoNotGrow) {
  geometry::Geometry ball;
  ball.surfaces.push_back({1, geometry::sphere({}, kRadius), {}});
  for (int i = 0; i < 50; ++i) {
    const int n = 1 + i % 3, order = 2 + i % 5;
    // The first ones have the poles in the middle of an element or at a node.
    const Eigen::Matrix3d turn =
        i < 6 ? Eigen::Matrix3d::Identity()
              : Eigen::AngleAxisd(0.37 * i, Eigen::Vector3d(1, 0.1 * i, 2 - 0.2 * i).normalized()).toRotationMatrix();
    SCOPED_TRACE("sphere " + std::to_string(i) + " of order " + std::to_string(order));
    GeometryOptions options;
    options.order = order;
    options.slide = SlideOn::None;
    HighOrderMesh straight = cubed_sphere(n, turn), as_made = straight;
    const auto made = slide_and_measure(as_made, options, ball);
    ASSERT_TRUE(made && made->distances) << made.error().sentence;
    expect_true(made->slid.report.before, as_made);
    options.slide = SlideOn::All;
    const auto slid = slide_and_measure(straight, options, ball);
    ASSERT_TRUE(slid && slid->distances) << slid.error().sentence;
    expect_true(slid->slid.report.after, straight);
    const BoundaryDistance before = sampled(as_made, 12), after = sampled(straight, 12);
    EXPECT_LE(after.rms, before.rms + 1e-9 * kRadius);
    EXPECT_LE(after.largest, before.largest + 1e-9 * kRadius);
  }
}

}  // namespace
}  // namespace varimesh
