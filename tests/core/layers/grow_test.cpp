// Thick layers that grow on walls: where nodes are, what is certified, what stays.
#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <set>
#include <string>

#include "tests/core/layers/grow_meshes.h"

namespace varimesh {
namespace {

std::size_t cells_of(const HighOrderMesh& mesh, Shape shape) {
  std::size_t count = 0;
  for (const ElementBlock& block : mesh.blocks) count += block.shape == shape ? block.size() : 0;
  return count;
}

/// The distances from y = 0 of the vertices of the row's cells that are not on the wall.
std::set<double> tops(const HighOrderMesh& mesh, Shape shape) {
  std::set<double> found;
  for (const ElementBlock& block : mesh.blocks) {
    if (block.shape != shape) continue;
    const std::size_t stride = block.nodes.size() / block.size();
    for (std::size_t e = 0; e < block.size(); ++e)
      for (int v = 0; v < reference::info(shape).vertices; ++v)
        if (const double y = mesh.coordinates[3 * at(block.nodes[e * stride + at(v)]) + 1]; y > 1e-12)
          found.insert(std::round(y * 1e9) / 1e9);
  }
  return found;
}

TEST(GrowLayer, StandsOnAPlaneWallThatEndsAtPlanes) {
  for (const bool flat : {true, false})
    for (const int order : {1, 2, 4}) {
      if (!flat && order == 4) continue;
      const HighOrderMesh mesh = simplices(3, 3, order, flat);
      const auto grown = grow(mesh, 0.2);
      ASSERT_TRUE(grown) << grown.error().sentence;
      expect_sound(mesh, grown->mesh);
      const Shape shape = flat ? Shape::Quadrilateral : Shape::Prism;
      EXPECT_EQ(cells_of(grown->mesh, shape), flat ? 3u : 18u);
      EXPECT_EQ(tops(grown->mesh, shape), std::set<double>{0.2});
      EXPECT_NEAR(volume(grown->mesh), 1, 1e-12);
      EXPECT_EQ(grown->full_share, 1);
      EXPECT_NE(grown->sentence.find("everywhere"), std::string::npos) << grown->sentence;
    }
}

/// A layer that is thicker than the cells at the wall pushes them away.
TEST(GrowLayer, PushesCellsAway) {
  const HighOrderMesh mesh = simplices(6, 6, 2, true);
  const auto grown = grow(mesh, 0.5);
  ASSERT_TRUE(grown) << grown.error().sentence;
  expect_sound(mesh, grown->mesh);
  EXPECT_EQ(tops(grown->mesh, Shape::Quadrilateral), std::set<double>{0.5});
  EXPECT_NEAR(volume(grown->mesh), 1, 1e-12);
}

/// A ring of triangles of this order between circles of radius 1, the wall, and 3.
HighOrderMesh ring(int around, int order) {
  HighOrderMesh mesh = *change_order(*to_simplices(box(Shape::Quadrilateral, around, 4)), order);
  constexpr double kTurn = 2 * std::numbers::pi;
  for (std::size_t n = 0; n < mesh.node_count(); ++n) {
    double* x = &mesh.coordinates[3 * n];
    const double angle = kTurn * 0.25 * x[0], radius = 1 + 2 * x[1];
    x[0] = radius * std::cos(angle);
    x[1] = radius * std::sin(angle);
  }
  return mesh;
}

TEST(GrowLayer, FollowsACurvedWall) {
  const HighOrderMesh mesh = ring(6, 3);  // a quarter; the wall ends at both axes
  const auto grown = grow(mesh, 0.1);
  ASSERT_TRUE(grown) << grown.error().sentence;
  for (std::size_t n = mesh.node_count(); n < grown->mesh.node_count(); ++n) {
    const double* x = &grown->mesh.coordinates[3 * n];
    const double height = std::hypot(x[0], x[1]) - 1;  // the copies of the wall's nodes, at thirds
    EXPECT_NEAR(height * 30, std::round(height * 30), 0.05) << height;
  }
  EXPECT_EQ(uncertified(grown->mesh), 0);
  EXPECT_EQ(grown->full_share, 1);
}

TEST(GrowLayer, GetsThinnerBetweenWalls) {
  const auto both = [](const Place& x) { return x[1] < 1e-9 || x[1] > 1 - 1e-9 ? 7 : 8; };
  const HighOrderMesh mesh = simplices(4, 4, 2, true, both);
  const auto grown = grow(mesh, 0.6);
  ASSERT_TRUE(grown) << grown.error().sentence;
  expect_sound(mesh, grown->mesh);
  EXPECT_LT(grown->full_share, 1);
  EXPECT_LT(grown->thickness[1], 0.5);
  EXPECT_GT(grown->thickness[0], 0.1);
  EXPECT_NE(grown->sentence.find("for want of room"), std::string::npos) << grown->sentence;
}

/// An L of triangles whose wall is the two sides of its inner corner, or those of its outer corner.
TEST(GrowLayer, GoesRoundCorners) {
  const HighOrderMesh square = box(Shape::Quadrilateral, 6, 6);
  std::vector<Place> places;
  for (std::size_t n = 0; n < square.node_count(); ++n)
    places.push_back({square.coordinates[3 * n], square.coordinates[3 * n + 1], 0});
  for (const bool inner : {true, false}) {
    std::vector<SmallCell> cells;
    for (const ElementBlock& block : square.blocks)
      for (std::size_t e = 0; block.shape == Shape::Quadrilateral && e < block.size(); ++e) {
        SmallCell cell{Shape::Quadrilateral,
                       {block.nodes.begin() + std::ptrdiff_t(4 * e), block.nodes.begin() + std::ptrdiff_t(4 * e + 4)}};
        const Place& x = places[at(cell.vertices[0])];
        if (x[0] < 0.49 || x[1] < 0.49) cells.push_back(std::move(cell));
      }
    const HighOrderMesh quads = small_mesh(places, cells, [&](const Place& x) {
      const bool at_inner = (std::abs(x[0] - 0.5) < 1e-9 && x[1] > 0.5) || (std::abs(x[1] - 0.5) < 1e-9 && x[0] > 0.5);
      const bool at_outer = x[0] < 1e-9 || x[1] < 1e-9;
      return (inner ? at_inner : at_outer) ? 7 : 8;
    });
    const HighOrderMesh mesh = *change_order(*to_simplices(quads), 3);
    const auto grown = grow(mesh, 0.1);
    ASSERT_TRUE(grown) << grown.error().sentence;
    expect_sound(mesh, grown->mesh);
    EXPECT_NEAR(volume(grown->mesh), 0.75, 1e-12);
    EXPECT_NEAR(grown->thickness[0], 0.1, 1e-9) << inner;
  }
}

TEST(GrowLayer, TakesTheSameBytesWithAnyNumberOfThreads) {
  const HighOrderMesh mesh = bent(simplices(3, 3, 1, false, [](const Place& x) { return x[1] < 1e-9 ? 7 : 8; }), 1, 0);
  const auto one = grow(mesh, 0.25, 1), three = grow(mesh, 0.25, 3);
  ASSERT_TRUE(one && three);
  EXPECT_EQ(one->mesh.coordinates, three->mesh.coordinates);
}

TEST(GrowLayer, IsThenSplit) {
  const auto grown = grow(simplices(3, 3, 2, false), 0.2);
  ASSERT_TRUE(grown) << grown.error().sentence;
  LayerOptions wanted = geometric(5, 1.5);
  wanted.grow = 0.2;
  const auto made = split(grown->mesh, wanted);
  ASSERT_TRUE(made) << made.error().sentence;
  EXPECT_EQ(uncertified(made->mesh), 0);
  EXPECT_EQ(made->report.cells_after, static_cast<std::int64_t>(grown->mesh.element_count(3)) + 4 * 18);
}

TEST(GrowLayer, KeepsPeriodicPairs) {
  HighOrderMesh mesh = simplices(3, 3, 2, true);
  PeriodicLink link{1, 8, 8, {}, {}};
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    for (std::size_t m = 0; m < mesh.node_count(); ++m)
      if (mesh.coordinates[3 * n] == 1 && mesh.coordinates[3 * m] == 0 &&
          std::abs(mesh.coordinates[3 * n + 1] - mesh.coordinates[3 * m + 1]) < 1e-12)
        link.nodes.emplace_back(static_cast<std::int32_t>(n), static_cast<std::int32_t>(m));
  const std::size_t had = link.nodes.size();
  mesh.periodic = {link};
  const auto grown = grow(mesh, 0.3);
  ASSERT_TRUE(grown) << grown.error().sentence;
  const auto& pairs = grown->mesh.periodic[0].nodes;
  EXPECT_EQ(pairs.size(), had + 2);
  for (const auto& [node, master] : pairs)
    EXPECT_NEAR(grown->mesh.coordinates[3 * at(node) + 1], grown->mesh.coordinates[3 * at(master) + 1], 1e-12);
}

/// The ends of a line inside the mesh and a point in it stay where they are, although everything around them moves.
TEST(GrowLayer, HoldsLinesAndPointsInsideTheMesh) {
  HighOrderMesh mesh = simplices(8, 8, 1, true);
  const auto node_at = [&](double x, double y) {
    for (std::size_t n = 0; n < mesh.node_count(); ++n)
      if (std::hypot(mesh.coordinates[3 * n] - x, mesh.coordinates[3 * n + 1] - y) < 1e-9)
        return static_cast<std::int32_t>(n);
    return -1;
  };
  const std::int32_t from = node_at(0.5, 0.5), to = node_at(0.625, 0.5), probe = node_at(0.25, 0.375);
  ElementBlock line{Shape::Line, 1, 9, {}, {9001}, {from, to}, {}, {}},
      point{Shape::Point, 1, 3, {}, {9002}, {probe}, {}, {}};
  mesh.blocks.insert(mesh.blocks.begin(), {point, line});
  const auto grown = grow(mesh, 0.2);
  ASSERT_TRUE(grown) << grown.error().sentence;
  expect_sound(mesh, grown->mesh);
  for (const std::int32_t node : {from, to, probe})
    for (std::size_t c = 0; c < 2; ++c)
      EXPECT_EQ(grown->mesh.coordinates[3 * at(node) + c], mesh.coordinates[3 * at(node) + c]);
}

/// Two entities of one plane keep their border if it ends at the wall.
TEST(GrowLayer, KeepsSeamsInPlanes) {
  const auto tag_of = [](const Place& x) { return x[1] < 1e-9 ? 7 : x[2] > 1e-9 ? 8 : x[0] < 0.5 ? 9 : 10; };
  const HighOrderMesh mesh = simplices(4, 4, 1, false, tag_of);
  const auto grown = grow(mesh, 0.2);
  ASSERT_TRUE(grown) << grown.error().sentence;
  expect_sound(mesh, grown->mesh);
  for (const ElementBlock& block : grown->mesh.blocks)
    for (const std::int32_t node : block.nodes)
      if (block.entity == 9 && reference::info(block.shape).dimension == 2) {
        EXPECT_LE(grown->mesh.coordinates[3 * at(node)], 0.5 + 1e-9);
      }
}

/// Triangles round the tip of a wedge of 16°, at the origin, whose sides are the wall.
HighOrderMesh round_a_wedge(double half_angle) {
  constexpr int kRings = 4, kAround = 12;
  std::vector<Place> places{{0, 0, 0}};
  std::vector<SmallCell> cells;
  const auto index = [&](int ring, int i) { return ring == 0 ? 0 : 1 + (ring - 1) * (kAround + 1) + i; };
  for (int ring = 1; ring <= kRings; ++ring)
    for (int i = 0; i <= kAround; ++i) {
      const double angle = (std::numbers::pi - half_angle) * (2.0 * i / kAround - 1);
      places.push_back({0.5 * ring * std::cos(angle), 0.5 * ring * std::sin(angle), 0});
    }
  for (int ring = 0; ring < kRings; ++ring)
    for (int i = 0; i < kAround; ++i) {
      cells.push_back({Shape::Triangle, {index(ring, i), index(ring + 1, i), index(ring + 1, i + 1)}});
      if (ring > 0) cells.push_back({Shape::Triangle, {index(ring, i), index(ring + 1, i + 1), index(ring, i + 1)}});
    }
  return small_mesh(places, cells, [&](const Place& x) {
    return std::abs(std::abs(std::atan2(x[1], x[0])) - (std::numbers::pi - half_angle)) < 1e-9 ? 7 : 8;
  });
}

/// At a sharp trailing edge the row and its layers are as thick as elsewhere.
TEST(GrowLayer, KeepsItsThicknessAtASharpEdge) {
  constexpr double kHalfAngle = 8 * std::numbers::pi / 180, kThickness = 0.03, kFirst = 1e-3;
  const HighOrderMesh mesh = *change_order(round_a_wedge(kHalfAngle), 2);
  const auto grown = grow(mesh, kThickness);
  ASSERT_TRUE(grown) << grown.error().sentence;
  expect_sound(mesh, grown->mesh);
  EXPECT_EQ(grown->full_share, 1);
  LayerOptions wanted = geometric(4, 0);
  wanted.first = kFirst;
  wanted.grow = kThickness;
  const auto made = split(grown->mesh, wanted);
  ASSERT_TRUE(made) << made.error().sentence;
  EXPECT_EQ(uncertified(made->mesh), 0);
  EXPECT_NEAR(made->report.first[1], kFirst, 1e-9);
  double nearest = 1;  // the height above the wall of the lowest vertex behind the edge
  for (const ElementBlock& block : made->mesh.blocks)
    for (std::size_t e = 0; block.shape == Shape::Quadrilateral && e < block.size(); ++e)
      for (std::size_t v = 0; v < 4; ++v)
        if (const double* x = &made->mesh.coordinates[3 * at(block.nodes[9 * e + v])];
            x[0] > 1e-9 && std::abs(x[1]) < 1e-9)
          nearest = std::min(nearest, x[0] * std::sin(kHalfAngle));
  EXPECT_NEAR(nearest, kFirst, 1e-9);
}

TEST(GrowLayer, RefusesWhereNoneCanGrow) {
  const auto sentence = [](const HighOrderMesh& mesh, double thickness, const std::string& wall) {
    const auto grown = grow(mesh, thickness, 1, {wall});
    return grown ? std::string() : grown.error().sentence;
  };
  const HighOrderMesh mesh = simplices(4, 2, 1, true, [](const Place& x) {
    return x[1] > 1e-9 ? 8 : x[0] < 0.5 ? 7 : 9;
  });
  EXPECT_NE(sentence(mesh, 0.1, "7").find("If it goes on, name it as a wall too"), std::string::npos);
  EXPECT_NE(sentence(mesh, 0.1, "wing").find("There is no wall 'wing'"), std::string::npos);
  for (const double thickness : {1e-20, 100.0})
    EXPECT_NE(sentence(mesh, thickness, "7").find("cannot grow in a mesh of size 1."), std::string::npos);
}

}  // namespace
}  // namespace varimesh
