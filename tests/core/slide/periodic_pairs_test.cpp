#include "core/slide/periodic_pairs.h"

#include <gtest/gtest.h>

#include "core/slide/on_file/slide_on_file.h"
#include "tests/core/support/disc_mesh.h"

namespace varimesh::detail {
namespace {

/// Nodes 0 to 4 and their images under the map, as a link without a map.
HighOrderMesh five_pairs(const Eigen::Matrix3d& turn, const Eigen::Vector3d& move) {
  HighOrderMesh mesh;
  PeriodicLink link;
  for (const Eigen::Vector3d& x : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 2, 0),
                                   Eigen::Vector3d(1, 1, 0), Eigen::Vector3d(0.3, 0.7, 0)})
    mesh.coordinates.insert(mesh.coordinates.end(), x.begin(), x.end());
  for (std::int32_t node = 0; node < 5; ++node) {
    const Eigen::Vector3d image =
        turn * Eigen::Map<const Eigen::Vector3d>(&mesh.coordinates[3 * std::size_t(node)]) + move;
    mesh.coordinates.insert(mesh.coordinates.end(), image.begin(), image.end());
    link.nodes.emplace_back(node + 5, node);
  }
  mesh.periodic.push_back(std::move(link));
  return mesh;
}

TEST(PeriodicPairs, HoldUnderTranslationsRotationsAndReflections) {
  const Eigen::Matrix3d rotation = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  const Eigen::Matrix3d reflection = Eigen::Vector3d(1, 1, -1).asDiagonal();
  for (const Eigen::Matrix3d& turn : {Eigen::Matrix3d(Eigen::Matrix3d::Identity()), rotation, reflection}) {
    const Eigen::Vector3d move(0.5, 0, 3);
    const HighOrderMesh mesh = five_pairs(turn, move);
    const PeriodicPairs pairs(mesh, 4);
    std::vector<bool> fixed(10, false);
    EXPECT_FALSE(pairs.fix_broken(mesh.coordinates, fixed));
    // Both nodes of a pair move: the link holds.
    std::vector<double> moved = mesh.coordinates;
    const Eigen::Vector3d by(0.2, -0.1, 0), image = turn * by;
    for (std::size_t k = 0; k < 3; ++k) {
      moved[3 + k] += by[Eigen::Index(k)];
      moved[18 + k] += image[Eigen::Index(k)];
    }
    EXPECT_FALSE(pairs.fix_broken(moved, fixed));
    EXPECT_EQ(fixed, std::vector<bool>(10, false));
    moved[18] += 1e-10;
    EXPECT_TRUE(pairs.fix_broken(moved, fixed));
    EXPECT_EQ(fixed, std::vector<bool>(10, true));
  }
}

TEST(PeriodicPairs, StayPairsInEveryWayToSlide) {
  HighOrderMesh start = testing::DiscMesh(2, 3).mesh();
  PeriodicLink link{2, 3, 2, {}, {}};  // the top is the image of the bottom
  const auto x = [](const HighOrderMesh& mesh, std::int32_t node) {
    return Eigen::Vector3d(Eigen::Map<const Eigen::Vector3d>(&mesh.coordinates[3 * std::size_t(node)]));
  };
  const auto count = static_cast<std::int32_t>(start.node_count());
  for (std::int32_t node = 0; node < count; ++node)
    for (std::int32_t master = 0; master < count; ++master)
      if ((x(start, node) - x(start, master) - Eigen::Vector3d::UnitZ()).norm() < 1e-12)
        link.nodes.emplace_back(node, master);
  ASSERT_GT(link.nodes.size(), 20u);
  start.periodic.push_back(link);
  for (const SlideOn slide : {SlideOn::All, SlideOn::Coupled}) {
    HighOrderMesh mesh = start;
    GeometryOptions options;
    options.slide = slide;
    const auto done = slide_on_model(mesh, options, testing::solid_cylinder());
    ASSERT_TRUE(done) << done.error().sentence;
    EXPECT_GT(done->report.nodes, 0) << static_cast<int>(slide);
    double worst = 0;
    int moved = 0;
    for (const auto& [node, master] : link.nodes) {
      worst = std::max(worst, (x(mesh, node) - x(mesh, master) - Eigen::Vector3d::UnitZ()).norm());
      moved += x(mesh, node) != x(start, node) ? 1 : 0;
    }
    EXPECT_LT(worst, 2e-12) << static_cast<int>(slide);
    EXPECT_GT(moved, 0) << "nodes of links slide, too";
  }
}

}  // namespace
}  // namespace varimesh::detail
