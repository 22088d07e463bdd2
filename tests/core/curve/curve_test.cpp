#include "core/curve/curve.h"

#include <gtest/gtest.h>

#include <map>
#include <numbers>

#include "core/association/plane/profile.h"
#include "core/geometry/analytic.h"
#include "core/mesh/check.h"
#include "core/quality/quality.h"
#include "core/slide/slide.h"
#include "tests/core/support/ring_mesh.h"
#include "tests/core/support/surface_grid.h"

namespace varimesh {
namespace {

using testing::ring_mesh;
using testing::surface_grid;
constexpr double kTurn = 2 * std::numbers::pi;

Association associated(const HighOrderMesh& mesh, const geometry::Geometry& geometry, const Team& team) {
  auto association = associate(mesh, geometry, team);
  EXPECT_TRUE(association) << association.error().sentence;
  return std::move(*association);
}

CurvedMesh curved(const HighOrderMesh& linear, const geometry::Geometry& geometry, int order, int threads = 1) {
  const Team team(threads);
  Expected<CurvedMesh> result;
  team.run([&] { result = curve(linear, associated(linear, geometry, team), order, team); });
  EXPECT_TRUE(result) << result.error().sentence;
  return std::move(*result);
}

// ===== A torus without curves =====

geometry::Geometry torus() {
  geometry::Geometry result;
  result.surfaces.push_back({1, geometry::torus({}, 2, 0.7), {}});
  return result;
}

HighOrderMesh linear_torus(int columns, int rows) {
  return surface_grid(*torus().surfaces[0].shape, columns, rows, 1, 1, true, [](double s, double t) {
    return std::array<double, 2>{kTurn * (s + 0.02 * std::sin(kTurn * t)), kTurn * (t + 0.05)};
  });
}

TEST(Curve, PutsAllNodesOnTheSurface) {
  const CurvedMesh made = curved(linear_torus(8, 5), torus(), 4);
  EXPECT_EQ(made.mesh.order, 4);
  EXPECT_EQ(made.report.held, 0);
  EXPECT_EQ(made.report.outside, 0);
  EXPECT_EQ(made.report.on_surfaces, 8 * 5 * 15);
  for (std::size_t node = 0; node < made.mesh.node_count(); ++node) {
    const double* x = &made.mesh.coordinates[3 * node];
    EXPECT_NEAR(std::hypot(std::hypot(x[0], x[1]) - 2, x[2]), 0.7, 1e-13);
    EXPECT_EQ(made.association.nodes[node].dimension, 2);
    const auto at = made.association.nodes[node].at;
    EXPECT_LT((torus().surfaces[0].shape->at(at[0], at[1]).x - Eigen::Map<const Eigen::Vector3d>(x)).norm(), 1e-12);
  }
}

/// A node is the foot of the middle of its neighbours, which is a little nearer to one of them if the surface bends
/// unevenly. On the small circles of this torus, the feet of even points of the chord differ by a fifth.
TEST(Curve, SpacesNodesOfEdgesEvenly) {
  const CurvedMesh made = curved(linear_torus(8, 5), torus(), 4);
  const ElementBlock& block = made.mesh.blocks[0];
  const auto x = [&](std::size_t element, int local) {
    const auto node = static_cast<std::size_t>(block.nodes[element * 25 + static_cast<std::size_t>(local)]);
    return Eigen::Vector3d(Eigen::Map<const Eigen::Vector3d>(&made.mesh.coordinates[3 * node]));
  };
  for (std::size_t e = 0; e < block.size(); ++e)
    for (int facet = 0; facet < 4; ++facet) {
      const std::vector<int>& n = reference::facet_nodes(Shape::Quadrilateral, 4, facet);
      const double chord = (x(e, n[0]) - x(e, n[2])).norm();
      EXPECT_NEAR((x(e, n[2]) - x(e, n[3])).norm(), chord, 2e-3 * chord);
      EXPECT_NEAR((x(e, n[3]) - x(e, n[4])).norm(), chord, 2e-3 * chord);
      EXPECT_NEAR((x(e, n[4]) - x(e, n[1])).norm(), chord, 2e-3 * chord);
    }
}

TEST(Curve, ConvergesWithOrderFourAtOrderThree) {
  double rms[2];
  for (int level = 0; level < 2; ++level) {
    CurvedMesh made = curved(linear_torus(8 << level, 5 << level), torus(), 3);
    const Team team(1);
    team.run([&] {
      rms[level] =
          slide(made.mesh, made.association, SlideOn::None, std::vector<bool>(made.mesh.node_count()), team).before.rms;
    });
  }
  EXPECT_GT(std::log2(rms[0] / rms[1]), 3.7);
}

TEST(Curve, HasTheSameBitsForAnyNumberOfThreads) {
  EXPECT_EQ(curved(linear_torus(8, 5), torus(), 3, 1).mesh.coordinates,
            curved(linear_torus(8, 5), torus(), 3, 3).mesh.coordinates);
}

TEST(Curve, LeavesThePolesOfASphere) {
  geometry::Geometry ball;
  ball.surfaces.push_back({1, geometry::sphere({}, 1), {}});
  // Four triangles around the north pole, and below them a band that reaches to 45 degrees south.
  HighOrderMesh mesh;
  mesh.dimension = 2;
  mesh.order = 1;
  ElementBlock block;
  block.shape = Shape::Triangle;
  block.entity = 1;
  mesh.coordinates = {0, 0, 1};
  for (const double v : {0.7, -0.7})
    for (int i = 0; i < 4; ++i)
      for (const double c :
           {std::cos(v) * std::cos(kTurn * i / 4 + 0.3), std::cos(v) * std::sin(kTurn * i / 4 + 0.3), std::sin(v)})
        mesh.coordinates.push_back(c);
  for (std::int32_t i = 0; i < 4; ++i) {
    const std::int32_t a = 1 + i, b = 1 + (i + 1) % 4;
    for (const std::int32_t node : {0, a, b, a, a + 4, b, b, a + 4, b + 4}) block.nodes.push_back(node);
  }
  for (std::int64_t n = 1; n <= 12; ++n) block.numbers.push_back(n);
  for (std::int64_t n = 1; n <= 9; ++n) mesh.node_numbers.push_back(n);
  mesh.blocks.push_back(block);
  mesh.node_blocks = {{-1, 0, 0, 9}};
  const CurvedMesh made = curved(mesh, ball, 3);
  const ElementBlock& cap = made.mesh.blocks[0];
  // The edges at the pole are meridians: their nodes keep the longitude of the other end.
  for (std::size_t e = 0; e < 12; e += 3)
    for (const int facet : {0, 2}) {
      const std::vector<int>& n = reference::facet_nodes(Shape::Triangle, 3, facet);
      const auto x = [&](int local) {
        const auto node = static_cast<std::size_t>(cap.nodes[e * 10 + static_cast<std::size_t>(local)]);
        return Eigen::Vector3d(Eigen::Map<const Eigen::Vector3d>(&made.mesh.coordinates[3 * node]));
      };
      const Eigen::Vector3d across = x(n[0]).cross(x(n[1])).normalized();
      for (const int k : {n[2], n[3]}) {
        EXPECT_NEAR(x(k).norm(), 1, 1e-13);
        EXPECT_NEAR(x(k).dot(across), 0, 1e-7);
      }
    }
}

// ===== A thick pipe of hexahedra =====

constexpr int kColumns = 6, kRows = 2;
/// Layers between the radii 1 and 2, which are thin at the outer wall.
const std::vector<double> kRadii{1, 1.5, 1.94, 1.96, 1.98, 2};

geometry::Geometry thick_pipe() {
  geometry::Geometry pipe;
  geometry::Frame top;
  top.origin = {0, 0, 2};
  // Surfaces: 0 inner wall, 1 outer wall, 2 bottom, 3 top.
  pipe.curves.push_back({1, geometry::circle({}, 1), {}, {0, 2}});
  pipe.curves.push_back({2, geometry::circle({}, 2), {}, {1, 2}});
  pipe.curves.push_back({3, geometry::circle(top, 1), {}, {0, 3}});
  pipe.curves.push_back({4, geometry::circle(top, 2), {}, {1, 3}});
  geometry::Frame corner, top_corner;
  corner.origin = {-3, -3, 0};
  top_corner.origin = {-3, -3, 2};
  pipe.surfaces.push_back({1, geometry::cylinder({}, 1, 2), {0, 2}});
  pipe.surfaces.push_back({2, geometry::cylinder({}, 2, 2), {1, 3}});
  pipe.surfaces.push_back({3, geometry::plane(corner, 6, 6), {0, 1}});
  pipe.surfaces.push_back({4, geometry::plane(top_corner, 6, 6), {2, 3}});
  return pipe;
}

HighOrderMesh linear_pipe() {
  HighOrderMesh mesh;
  mesh.dimension = 3;
  mesh.order = 1;
  const int radii = static_cast<int>(kRadii.size());
  const auto node = [&](int column, int row, int ring) {
    return static_cast<std::int32_t>(((column % kColumns) * (kRows + 1) + row) * radii + ring);
  };
  for (int column = 0; column < kColumns; ++column)
    for (int row = 0; row <= kRows; ++row)
      for (const double radius : kRadii) {
        const double angle = kTurn * (column + 0.3) / kColumns;
        for (const double c : {radius * std::cos(angle), radius * std::sin(angle), 2.0 * row / kRows})
          mesh.coordinates.push_back(c);
        mesh.node_numbers.push_back(static_cast<std::int64_t>(mesh.node_numbers.size()) + 1);
      }
  std::int64_t number = 0;
  const auto add = [&](ElementBlock& block, std::initializer_list<std::int32_t> nodes) {
    block.numbers.push_back(++number);
    block.nodes.insert(block.nodes.end(), nodes);
  };
  std::vector<ElementBlock> walls(4);
  ElementBlock cells;
  cells.shape = Shape::Hexahedron;
  cells.entity = 1;
  for (std::size_t k = 0; k < 4; ++k) {
    walls[k].shape = Shape::Quadrilateral;
    walls[k].entity = static_cast<int>(k) + 1;
  }
  for (int i = 0; i < kColumns; ++i) {
    for (int j = 0; j < kRows; ++j) {
      add(walls[0], {node(i, j, 0), node(i, j + 1, 0), node(i + 1, j + 1, 0), node(i + 1, j, 0)});
      add(walls[1],
          {node(i, j, radii - 1), node(i + 1, j, radii - 1), node(i + 1, j + 1, radii - 1), node(i, j + 1, radii - 1)});
      for (int k = 0; k + 1 < radii; ++k)
        add(cells, {node(i, j, k), node(i, j, k + 1), node(i + 1, j, k + 1), node(i + 1, j, k), node(i, j + 1, k),
                    node(i, j + 1, k + 1), node(i + 1, j + 1, k + 1), node(i + 1, j + 1, k)});
    }
    for (int k = 0; k + 1 < radii; ++k) {
      add(walls[2], {node(i, 0, k), node(i + 1, 0, k), node(i + 1, 0, k + 1), node(i, 0, k + 1)});
      add(walls[3], {node(i, kRows, k), node(i, kRows, k + 1), node(i + 1, kRows, k + 1), node(i + 1, kRows, k)});
    }
  }
  for (ElementBlock& wall : walls) mesh.blocks.push_back(std::move(wall));
  mesh.blocks.push_back(std::move(cells));
  mesh.node_blocks = {{-1, 0, 0, static_cast<std::int32_t>(mesh.node_count())}};
  return mesh;
}

double radius(const HighOrderMesh& mesh, std::int32_t node) {
  const double* x = &mesh.coordinates[3 * static_cast<std::size_t>(node)];
  return std::hypot(x[0], x[1]);
}

TEST(Curve, PutsNodesOfEdgesOnCurvesAndOthersOnSurfaces) {
  const CurvedMesh made = curved(linear_pipe(), thick_pipe(), 3);
  EXPECT_EQ(made.report.held, 0);
  // Two new nodes on each of the four circles' edges.
  EXPECT_EQ(made.report.on_curves, 4 * kColumns * 2);
  for (const std::size_t wall : {0U, 1U}) {
    const ElementBlock& block = made.mesh.blocks[wall];
    for (const std::int32_t node : block.nodes) EXPECT_NEAR(radius(made.mesh, node), wall + 1.0, 1e-13);
  }
  for (const std::size_t end : {2U, 3U})
    for (const std::int32_t node : made.mesh.blocks[end].nodes)
      EXPECT_NEAR(made.mesh.coordinates[3 * static_cast<std::size_t>(node) + 2], end == 3 ? 2 : 0, 1e-14);
}

TEST(Curve, KeepsTheHeightsOfLayersAndTheirElementsValid) {
  const HighOrderMesh linear = linear_pipe();
  // The chord of a sixth of the outer circle is farther from it than all thin layers together are high.
  ASSERT_GT(2 - 2 * std::cos(kTurn / 12), 2 - kRadii[2]);
  const CurvedMesh made = curved(linear, thick_pipe(), 4);
  EXPECT_GT(made.report.in_layers, 0);
  const ElementBlock& cells = made.mesh.blocks[4];
  const auto& lattice = reference::lattice(Shape::Hexahedron, 4);
  std::map<std::array<std::int8_t, 3>, std::size_t> at;
  for (std::size_t k = 0; k < lattice.size(); ++k) at[lattice[k]] = k;
  const std::size_t layers = kRadii.size() - 1;
  for (std::size_t e = 0; e < cells.size(); ++e) {
    if (e % layers < 2) continue;  // the two inner ones are not thin
    for (const auto& place : lattice) {
      if (place[0] != 0) continue;
      const auto x = [&](std::int8_t along) {
        const std::array<std::int8_t, 3> there{along, place[1], place[2]};
        const auto node = static_cast<std::size_t>(cells.nodes[e * lattice.size() + at.at(there)]);
        return Eigen::Vector3d(Eigen::Map<const Eigen::Vector3d>(&made.mesh.coordinates[3 * node]));
      };
      // Straight sides have the same height everywhere up to the cosine of the half angle of a column.
      const double height = (x(4) - x(0)).norm();
      EXPECT_LE(height, 0.02 * (1 + 1e-9));
      EXPECT_GE(height, 0.02 * std::cos(kTurn / 12) * (1 - 1e-9));
    }
  }
  EXPECT_EQ(quality(made.mesh).invalid_elements, 0);
}

TEST(Curve, NamesTheSurfacesOfNodesThatItHolds) {
  geometry::Geometry pipe = thick_pipe();
  pipe.curves[3].shape = geometry::circle({}, 5);  // no edge of the mesh lies there
  const CurvedMesh made = curved(linear_pipe(), pipe, 3);
  EXPECT_EQ(made.report.held_tags, (std::vector<int>{2, 4}));
  ASSERT_EQ(made.report.sentences().size(), 2U);
  const std::string said = made.report.sentences()[1];
  EXPECT_NE(said.find("surfaces 2, 4 of the mesh"), std::string::npos);
  // Vertices stay where they came anyway. Each of the circle's edges has two new nodes.
  EXPECT_EQ(made.report.held, 2 * kColumns);
  // Those of the wall. The end is flat.
  EXPECT_EQ(made.report.straight, kColumns);
  EXPECT_NE(said.find("curved at " + std::to_string(kColumns) + " elements"), std::string::npos);
}

// ===== Plane meshes =====

CurvedMesh curved_ring(const HighOrderMesh& ring, const std::vector<double>& radii, int order) {
  geometry::Geometry circles;
  for (const double radius : radii) circles.curves.push_back({1, geometry::circle({}, radius), {}, {}});
  const Team team(1);
  Expected<CurvedMesh> result;
  team.run([&] { result = curve(ring, associate_in_plane(ring, circles, team).value(), order, team); });
  EXPECT_TRUE(result) << result.error().sentence;
  return std::move(*result);
}

TEST(Curve, KeepsTheHeightsOfLayersInAPlane) {
  // The first layers are thinner than a straight wall is off the circle.
  for (const bool triangles : {false, true})
    for (const int order : {2, 3, 5}) {
      const CurvedMesh made = curved_ring(ring_mesh({1, 1.005, 1.012, 1.5, 3}, kColumns, triangles), {1, 3}, order);
      EXPECT_EQ(made.report.on_curves, 2 * kColumns * (order - 1));
      EXPECT_EQ(made.report.held, 0);
      EXPECT_EQ(made.report.straight, 0);
      EXPECT_EQ(quality(made.mesh).invalid_elements, 0) << triangles << ' ' << order;
    }
}

TEST(Curve, CountsElementsAtACurvedBorderWithoutACurve) {
  const CurvedMesh made = curved_ring(ring_mesh({1, 2, 3}, kColumns), {1}, 2);
  EXPECT_EQ(made.report.straight, kColumns);
  EXPECT_EQ(made.report.held, kColumns);
}

TEST(Curve, SpeaksOfOneSurfaceAndOneNode) {
  CurveReport report;
  report.held = 1;
  report.held_tags = {7};
  report.outside = 2;
  report.outside_surfaces = {"5 'Fillet'"};
  const std::vector<std::string> sentences = report.sentences();
  ASSERT_EQ(sentences.size(), 3u);
  EXPECT_TRUE(sentences[1].starts_with("1 new boundary node stays on a straight side")) << sentences[1];
  EXPECT_NE(sentences[1].find("it lies on surface 7 of the mesh"), std::string::npos) << sentences[1];
  EXPECT_NE(sentences[2].find("they are on surface 5 'Fillet' of"), std::string::npos) << sentences[2];
}

TEST(Curve, RefusesAnOrderThatDoesNotExist) {
  const Team team(1);
  team.run([&] {
    const HighOrderMesh linear = linear_torus(8, 5);
    const auto made = curve(linear, associated(linear, torus(), team), 11, team);
    ASSERT_FALSE(made);
    EXPECT_EQ(made.error().kind, Error::Kind::BadOption);
  });
}

}  // namespace
}  // namespace varimesh
