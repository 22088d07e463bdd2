// Rows that grow on walls which end at curved boundaries, with the shape of the mesh or of a model; and rows for which
// there is no time.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/association/plane/profile.h"
#include "core/geometry/analytic.h"
#include "core/layers/facet_table.h"
#include "tests/core/layers/grow_meshes.h"

namespace varimesh {
namespace {

/// A box or rectangle whose sides bend: x and z grow with y².
HighOrderMesh bent_box(int cells, int order, bool flat, const std::function<int(const Place&)>& tag_of) {
  HighOrderMesh mesh = simplices(cells, cells, order, flat, tag_of);
  for (std::size_t n = 0; n < mesh.node_count(); ++n) {
    double* x = &mesh.coordinates[3 * n];
    x[0] += 0.3 * x[1] * x[1];
    if (!flat) x[2] += 0.2 * x[1] * x[1];
  }
  return mesh;
}

int wall_or_side(const Place& x) { return x[1] < 1e-9 ? 7 : 8; }

/// How far a point of a side of bent_box() is from the bent surface that is nearest.
double off_sides(const double* x, bool flat) {
  const double a = x[0] - 0.3 * x[1] * x[1], c = x[2] - 0.2 * x[1] * x[1];
  const double off_x = std::min(std::abs(a), std::abs(a - 1)), off_z = std::min(std::abs(c), std::abs(c - 1));
  return std::min({flat ? off_x : std::min(off_x, off_z), std::abs(x[1] - 1)});
}

TEST(GrowLayer, FollowsCurvedSides) {
  for (const bool flat : {true, false})
    for (const int order : {2, 3}) {
      if (!flat && order == 3) continue;
      for (const double thickness : {0.1, 0.4}) {  // cells are 1/4 or 1/3 high
        const HighOrderMesh mesh = bent_box(flat ? 4 : 3, order, flat, wall_or_side);
        const auto grown = grow(mesh, thickness);
        ASSERT_TRUE(grown) << grown.error().sentence;
        expect_sound(mesh, grown->mesh);
        EXPECT_EQ(grown->full_share, 1) << thickness;
        EXPECT_NEAR(volume(grown->mesh), 1, 1e-3);
        for (const ElementBlock& block : grown->mesh.blocks)
          for (const std::int32_t node : block.nodes)
            if (block.entity == 8 && reference::info(block.shape).dimension == mesh.dimension - 1) {
              EXPECT_LT(off_sides(&grown->mesh.coordinates[3 * at(node)], flat), 1e-9) << order << " " << thickness;
            }
      }
    }
}

/// Two entities that are one smooth surface keep their border.
TEST(GrowLayer, KeepsSeamsInCurvedSides) {
  const HighOrderMesh mesh = bent_box(4, 2, false, [](const Place& x) {
    return x[1] < 1e-9 ? 7 : x[0] > 1e-9 ? 8 : x[2] < 0.5 ? 9 : 10;
  });
  const auto grown = grow(mesh, 0.15);
  ASSERT_TRUE(grown) << grown.error().sentence;
  expect_sound(mesh, grown->mesh);
  for (const ElementBlock& block : grown->mesh.blocks)
    for (const std::int32_t node : block.nodes)
      if (block.entity == 9 && reference::info(block.shape).dimension == 2) {
        const double* x = &grown->mesh.coordinates[3 * at(node)];
        EXPECT_LT(std::abs(x[0] - 0.3 * x[1] * x[1]), 1e-9);
        EXPECT_LT(x[2] - 0.2 * x[1] * x[1], 0.5 + 1e-9);
      }
}

/// A straight line inside a curved side, such as the seam of a cylinder, makes room along itself.
TEST(GrowLayer, SlidesVerticesAlongSeams) {
  HighOrderMesh mesh = simplices(4, 4, 2, false, wall_or_side);
  ElementBlock seam{Shape::Line, 2, 9, {}, {}, {}, {}, {}};
  const auto node_at = [&](double y) {
    for (std::size_t n = 0; n < mesh.node_count(); ++n)
      if (const double* x = &mesh.coordinates[3 * n]; std::hypot(x[0], x[1] - y, x[2] - 0.5) < 1e-9)
        return static_cast<std::int32_t>(n);
    return -1;
  };
  for (int part = 0; part < 4; ++part) {
    seam.numbers.push_back(9001 + part);
    seam.nodes.insert(seam.nodes.end(),
                      {node_at(0.25 * part), node_at(0.25 * (part + 1)), node_at(0.25 * part + 0.125)});
  }
  for (std::size_t n = 0; n < mesh.node_count(); ++n) {  // the side x = 0 is a cylinder now
    double* x = &mesh.coordinates[3 * n];
    x[0] -= 0.3 * (1 - x[0]) * x[2] * (1 - x[2]);
  }
  mesh.blocks.insert(mesh.blocks.begin(), seam);
  const auto grown = grow(mesh, 0.4);
  ASSERT_TRUE(grown) << grown.error().sentence;
  expect_sound(mesh, grown->mesh);
  EXPECT_EQ(grown->full_share, 1);
  for (const ElementBlock& block : grown->mesh.blocks)
    for (const std::int32_t node : block.nodes)
      if (block.entity == 9) {
        const double* x = &grown->mesh.coordinates[3 * at(node)];
        EXPECT_NEAR(x[0], -0.075, 1e-9);
        EXPECT_NEAR(x[2], 0.5, 1e-9);
      }
}

/// A sector of a ring of triangles with straight sides, between circles of radius 1 and 3. It is not spaced evenly.
HighOrderMesh sector(const std::function<int(const Place&)>& tag_of) {
  HighOrderMesh mesh = simplices(6, 6, 1, true, tag_of);
  for (std::size_t n = 0; n < mesh.node_count(); ++n) {
    double* x = &mesh.coordinates[3 * n];
    const double angle = 0.5 * std::numbers::pi * std::pow(x[1], 1.3), radius = 1 + 2 * x[0];
    x[0] = radius * std::cos(angle);
    x[1] = radius * std::sin(angle);
  }
  return mesh;
}

Expected<GrownLayer> grow_in_ring(const HighOrderMesh& mesh, double thickness, bool with_model) {
  const Team team(1);
  const auto checked = check_mesh(mesh, CheckFor::Judging, team);
  if (!checked) return tl::unexpected(checked.error());
  geometry::Geometry circles;
  for (const int radius : {1, 3}) circles.curves.push_back({radius, geometry::circle({}, radius), {}, {}});
  Expected<Association> model;
  team.run([&] { model = associate_in_plane(checked->mesh, circles, team); });
  if (!model) return tl::unexpected(model.error());
  return grow_layer(*checked, std::vector<std::string>{"7"}, thickness, team, with_model ? &*model : nullptr);
}

TEST(GrowLayer, FollowsTheCurvesOfTheModel) {
  const HighOrderMesh mesh = sector(wall_or_side);  // the wall is the line from 1 to 3, and ends at both circles
  for (const bool with_model : {true, false}) {
    const auto grown = grow_in_ring(mesh, 0.15, with_model);
    ASSERT_TRUE(grown) << grown.error().sentence;
    EXPECT_EQ(uncertified(grown->mesh), 0);
    double off = 0;
    for (std::size_t n = mesh.node_count(); n < grown->mesh.node_count(); ++n) {
      const double radius = std::hypot(grown->mesh.coordinates[3 * n], grown->mesh.coordinates[3 * n + 1]);
      if (std::min(std::abs(radius - 1), std::abs(radius - 3)) < 0.1)
        off = std::max(off, std::min(std::abs(radius - 1), std::abs(radius - 3)));
    }
    // Straight sides leave the circle.
    if (with_model)
      EXPECT_LT(off, 1e-9);
    else
      EXPECT_GT(off, 1e-3);
  }
}

TEST(GrowLayer, TakesTheNormalsOfAPlaneModel) {
  const HighOrderMesh mesh = sector([](const Place& x) { return x[0] < 1e-9 ? 7 : 8; });  // the inner circle
  for (const bool with_model : {true, false}) {
    const auto grown = grow_in_ring(mesh, 0.1, with_model);
    ASSERT_TRUE(grown) << grown.error().sentence;
    double off = 0;
    for (std::size_t n = mesh.node_count(); n < grown->mesh.node_count(); ++n) {
      const Eigen::Map<const Eigen::Vector3d> top(&grown->mesh.coordinates[3 * n]);
      double nearest = 1e9;
      for (std::size_t m = 0; m < mesh.node_count(); ++m) {
        const Eigen::Map<const Eigen::Vector3d> foot(&mesh.coordinates[3 * m]);
        if (std::abs(foot.norm() - 1) < 1e-12) nearest = std::min(nearest, (top - 1.1 * foot).norm());
      }
      off = std::max(off, nearest);
    }
    if (with_model)
      EXPECT_LT(off, 1e-9);
    else
      EXPECT_GT(off, 1e-4);
  }
}

// ===== No time =====

TEST(GrowLayer, IsThinIfTheTimeLimitPasses) {
  const HighOrderMesh mesh = simplices(6, 6, 2, true);
  const auto checked = check_mesh(mesh, CheckFor::Judging, Team(1));
  ASSERT_TRUE(checked) << checked.error().sentence;
  StopToken late;
  late.stop_after(0);
  Team team(1);
  team.set_stop(&late);
  const auto grown = grow_layer(*checked, std::vector<std::string>{"7"}, 0.5, team);
  ASSERT_TRUE(grown) << grown.error().sentence;
  expect_sound(mesh, grown->mesh);
  EXPECT_GT(grown->thickness[0], 0.02);
  EXPECT_LT(grown->thickness[1], 1.0 / 6);  // the cells beyond it are where they were
  EXPECT_NE(grown->sentence.find("The time limit passed while it grew"), std::string::npos) << grown->sentence;
}

TEST(GrowLayer, EndsIfSomebodyAsks) {
  const auto checked = check_mesh(simplices(6, 6, 2, true), CheckFor::Judging, Team(1));
  ASSERT_TRUE(checked);
  const StopToken asked([] { return true; });
  Team team(1);
  team.set_stop(&asked);
  EXPECT_THROW((void)grow_layer(*checked, std::vector<std::string>{"7"}, 0.5, team), Interrupted);
}

// ===== Normals of curved facets =====

HighOrderMesh line_of(const std::vector<Place>& places) {
  HighOrderMesh mesh;
  mesh.dimension = 2;
  mesh.order = 2;
  for (const Place& x : places) mesh.coordinates.insert(mesh.coordinates.end(), x.begin(), x.end());
  return mesh;
}

/// The cell leans so much that the normal at one end of the bent facet points away from its centre.
TEST(FacetTable, TakesAllNormalsOnOneSide) {
  const HighOrderMesh bent = line_of({{-1, 0, 0}, {1, 0, 0}, {0, -0.5, 0}});
  const std::vector<std::int32_t> nodes{0, 1, 2};
  const auto normals = detail::FacetTable(Shape::Line, 2, 2).normals(bent, nodes, Eigen::Vector3d(1, 0.3, 0));
  EXPECT_LT((normals[0] - Eigen::Vector3d(std::sqrt(0.5), std::sqrt(0.5), 0)).norm(), 1e-12);
  EXPECT_LT((normals[1] - Eigen::Vector3d(-std::sqrt(0.5), std::sqrt(0.5), 0)).norm(), 1e-12);
}

TEST(FacetTable, TakesTheStraightFacetsNormalWhereAFacetIsFolded) {
  const HighOrderMesh folded = line_of({{-1, 0, 0}, {1, 0, 0}, {1.5, 0, 0}});
  const std::vector<std::int32_t> nodes{0, 1, 2};
  for (const Eigen::Vector3d& normal :
       detail::FacetTable(Shape::Line, 2, 2).normals(folded, nodes, Eigen::Vector3d(0, 1, 0)))
    EXPECT_LT((normal - Eigen::Vector3d(0, 1, 0)).norm(), 1e-12);
}

}  // namespace
}  // namespace varimesh
