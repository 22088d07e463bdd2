// Nodes on the flat sides at which a wall ends get the spacing of their layers too, and the sides keep their shape.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/layers/layers.h"
#include "core/optimise/optimiser.h"
#include "tests/core/layers/layer_meshes.h"

namespace varimesh {
namespace {

/// The ends of the quarter are the planes x = 0 and y = 0, its other sides z = 0 and z = .6.
struct Place {
  bool at_end, at_side;
  double distance;  ///< From the wall.
};

Place place_of(const HighOrderMesh& mesh, const std::vector<double>& coordinates, std::size_t node) {
  const double* x = &coordinates[3 * node];
  const bool is_at_side = mesh.dimension == 3 && (std::abs(x[2]) < 1e-12 || std::abs(x[2] - 0.3 * kAlong) < 1e-12);
  return {std::abs(x[0]) < 1e-12 || std::abs(x[1]) < 1e-12, is_at_side, std::hypot(x[0], x[1]) - 1};
}

LayerStart start_with(const HighOrderMesh& mesh, OnFlatSides on_flat_sides) {
  const Team team(1);
  LayerStart started;
  team.run([&] {
    const Facets found = facets(mesh, team);
    started = start_layers(mesh, found, fixed_nodes(mesh, found), LayerSpacing::Graded, on_flat_sides, team);
  });
  return started;
}

/// How many nodes at the ends of the quarter have another distance from the wall.
int moved_at_ends(const HighOrderMesh& mesh, const std::vector<double>& coordinates) {
  EXPECT_EQ(coordinates.size(), mesh.coordinates.size());
  if (coordinates.size() != mesh.coordinates.size()) return -1;
  int moved = 0;
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    const Place came = place_of(mesh, mesh.coordinates, node);
    if (came.at_end && std::abs(place_of(mesh, coordinates, node).distance - came.distance) > 1e-6) ++moved;
  }
  return moved;
}

class SidesOfShape : public testing::TestWithParam<Shape> {};

/// In a geometric progression of heights with the growth g, a node at the share ξ of its layer is at the share
/// (g^.6ξ − 1)/(g^.6 − 1) of the height: on the sides and inside.
TEST_P(SidesOfShape, HaveTheSpacingToo) {
  const Layers layers{GetParam(), 3, 6, 1e-3, 1.9, Inside::Parallel};
  const HighOrderMesh mesh = make(layers);
  const LayerStart started = start_with(mesh, OnFlatSides::Slide);
  ASSERT_EQ(started.coordinates.size(), mesh.coordinates.size());
  EXPECT_EQ(uncertified(mesh, started.coordinates), 0);
  int on_sides = 0;
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    const Place came = place_of(mesh, mesh.coordinates, node), is = place_of(mesh, started.coordinates, node);
    EXPECT_EQ(is.at_end, came.at_end);
    EXPECT_EQ(is.at_side, came.at_side);
    if (came.distance > layers.height(4)) continue;
    int layer = 0;
    while (layers.height(layer + 1) < came.distance * (1 - 1e-9)) ++layer;
    const double height = layers.height(layer + 1) - layers.height(layer);
    const double xi = (came.distance - layers.height(layer)) / height, rate = 0.6 * std::log(layers.growth);
    const double wanted = layers.height(layer) + height * std::expm1(rate * xi) / std::expm1(rate);
    EXPECT_NEAR(is.distance, wanted, 2e-3 * height);
    on_sides += (is.at_end || is.at_side) && std::abs(is.distance - came.distance) > 0.03 * height ? 1 : 0;
  }
  EXPECT_GT(on_sides, 10);
}

INSTANTIATE_TEST_SUITE_P(All, SidesOfShape,
                         testing::Values(Shape::Quadrilateral, Shape::Triangle, Shape::Hexahedron, Shape::Prism,
                                         Shape::Tetrahedron),
                         [](const auto& of) { return std::string(reference::info(of.param).name); });

TEST(FlatSides, StayIfNodesAreToStay) {
  const HighOrderMesh mesh = make({Shape::Quadrilateral, 3, 6, 1e-3, 1.9, Inside::Parallel});
  EXPECT_GT(moved_at_ends(mesh, start_with(mesh, OnFlatSides::Slide).coordinates), 10);
  EXPECT_EQ(moved_at_ends(mesh, start_with(mesh, OnFlatSides::Stay).coordinates), 0);
}

TEST(FlatSides, OfARunStayIfItsOptionsFixNodes) {
  const HighOrderMesh mesh = make({Shape::Quadrilateral, 3, 6, 1e-3, 1.9, Inside::Parallel});
  Options options;
  options.layer_spacing = LayerSpacing::Graded;
  const auto slides = optimise(mesh, options);
  options.fix_nodes = {mesh.node_numbers.front()};
  const auto stays = optimise(mesh, options);
  ASSERT_TRUE(slides.has_value() && stays.has_value());
  EXPECT_GT(moved_at_ends(mesh, slides->mesh.coordinates), 10);
  EXPECT_EQ(moved_at_ends(mesh, stays->mesh.coordinates), 0);
}

TEST(FlatSides, StayIfAPeriodicLinkHasThem) {
  HighOrderMesh mesh = make({Shape::Quadrilateral, 3, 6, 1e-3, 1.9, Inside::Parallel});
  PeriodicLink link;
  link.dimension = 1;
  for (std::size_t node = 0; node < mesh.node_count(); ++node)
    for (std::size_t image = 0; image < mesh.node_count(); ++image) {
      const double *a = &mesh.coordinates[3 * node], *b = &mesh.coordinates[3 * image];
      if (std::abs(a[1]) < 1e-12 && std::abs(b[0]) < 1e-12 && std::abs(a[0] - b[1]) < 1e-12)
        link.nodes.emplace_back(static_cast<std::int32_t>(node), static_cast<std::int32_t>(image));
    }
  ASSERT_EQ(link.nodes.size(), 19U);
  mesh.periodic = {link};
  EXPECT_EQ(moved_at_ends(mesh, start_with(mesh, OnFlatSides::Slide).coordinates), 0);
}

/// One of the two ends is bent: the nodes there stay, and those of the other end move.
TEST(FlatSides, AreNotCurved) {
  HighOrderMesh mesh = make({Shape::Triangle, 3, 6, 1e-3, 1.9, Inside::Parallel});
  std::vector<std::size_t> bent;
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    double* x = &mesh.coordinates[3 * node];
    if (std::abs(x[1]) > 1e-12) continue;
    bent.push_back(node);
    x[1] = 1e-2 * (x[0] - 1) * (x[0] - 1.02);
  }
  const LayerStart started = start_with(mesh, OnFlatSides::Slide);
  ASSERT_EQ(started.coordinates.size(), mesh.coordinates.size());
  for (const std::size_t node : bent)
    EXPECT_TRUE(
        std::equal(&mesh.coordinates[3 * node], &mesh.coordinates[3 * node] + 3, &started.coordinates[3 * node]));
  EXPECT_GT(moved_at_ends(mesh, started.coordinates), 5);
}

/// Adds elements to the side z = 0: those up to the angle of `border` cells are of one entity, the others of the
/// second.
void add_elements(HighOrderMesh& mesh, int border, int second) {
  std::array<ElementBlock, 2> sides;
  const Cells cells(mesh, mesh.dimension);
  for (std::size_t cell = 0; cell < cells.count(); ++cell)
    for (std::size_t f = 0; f < reference::info(Shape::Hexahedron).facets.size(); ++f) {
      std::vector<std::int32_t> nodes;
      for (const int local : reference::facet_nodes(Shape::Hexahedron, mesh.order, static_cast<int>(f)))
        nodes.push_back(cells.nodes(cell)[at(local)]);
      if (!std::ranges::all_of(nodes, [&](std::int32_t node) { return mesh.coordinates[3 * at(node) + 2] < 1e-12; }))
        continue;
      double angle = 0;
      for (int v = 0; v < 4; ++v)
        angle += std::atan2(mesh.coordinates[3 * at(nodes[at(v)])], mesh.coordinates[3 * at(nodes[at(v)]) + 1]) / 4;
      ElementBlock& side = sides[angle < border * std::acos(-1.0) / 2 / kAround ? 0 : 1];
      side.numbers.push_back(static_cast<std::int64_t>(1000 + cell));
      side.nodes.insert(side.nodes.end(), nodes.begin(), nodes.end());
    }
  for (std::size_t i = 0; i < 2; ++i) {
    sides[i].shape = Shape::Quadrilateral;
    sides[i].order = mesh.order;
    sides[i].entity = i == 0 ? 1 : second;
    mesh.blocks.push_back(sides[i]);
  }
}

/// Two entities meet in the plane z = 0: the border between them stays. If they are one, its nodes move.
TEST(FlatSides, OfTwoEntitiesInOnePlaneKeepTheirBorder) {
  constexpr int kBorder = 2;
  for (const int second : {1, 2}) {
    HighOrderMesh mesh = make({Shape::Hexahedron, 3, 6, 1e-3, 1.9, Inside::Parallel});
    add_elements(mesh, kBorder, second);
    const LayerStart started = start_with(mesh, OnFlatSides::Slide);
    ASSERT_EQ(started.coordinates.size(), mesh.coordinates.size());
    int moved = 0;
    for (std::size_t node = 0; node < mesh.node_count(); ++node) {
      const double* x = &mesh.coordinates[3 * node];
      const double angle = std::atan2(x[0], x[1]) / (std::acos(-1.0) / 2 / kAround);
      if (x[2] > 1e-12 || std::abs(angle - kBorder) > 1e-6) continue;
      const double came = std::hypot(x[0], x[1]);
      moved += std::abs(place_of(mesh, started.coordinates, node).distance - (came - 1)) > 1e-6 ? 1 : 0;
    }
    if (second == 1)
      EXPECT_GT(moved, 8);
    else
      EXPECT_EQ(moved, 0);
  }
}

}  // namespace
}  // namespace varimesh
