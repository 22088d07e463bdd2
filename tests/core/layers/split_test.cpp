// Thick cells are split into layers: the mesh stays conforming, and no shape changes.
#include <gtest/gtest.h>

#include <algorithm>

#include "core/quality/quality.h"
#include "tests/core/layers/split_meshes.h"

namespace varimesh {
namespace {

/// How many elements of a shape the mesh has.
std::size_t count(const HighOrderMesh& mesh, Shape shape) {
  std::size_t sum = 0;
  for (const ElementBlock& block : mesh.blocks)
    if (block.shape == shape) sum += block.size();
  return sum;
}

/// Heights of the vertices above y = 0 in a straight mesh, each once.
std::set<double> levels(const HighOrderMesh& mesh) {
  std::set<double> levels;
  const Cells cells(mesh, mesh.dimension);
  for (std::size_t cell = 0; cell < cells.count(); ++cell)
    for (int v = 0; v < reference::info(cells.shape(cell)).vertices; ++v)
      levels.insert(std::round(1e9 * mesh.coordinates[3 * at(cells.nodes(cell)[at(v)]) + 1]) / 1e9);
  return levels;
}

void expect_whole(const HighOrderMesh& before, const HighOrderMesh& after) {
  const Expected<void> checked = check_structure(after);
  EXPECT_TRUE(checked) << (checked ? "" : checked.error().sentence);
  EXPECT_NEAR(volume(after), volume(before), 1e-12 * volume(before));
}

TEST(SplitLayers, HaveTheHeightsThatWereAskedFor) {
  for (const Shape shape : {Shape::Quadrilateral, Shape::Prism, Shape::Hexahedron}) {
    const auto made = split(box(shape, 3, 1, 2), geometric(3, 2));
    ASSERT_TRUE(made) << made.error().sentence;
    const std::set<double> expected{0, std::round(1e9 / 7) / 1e9, std::round(3e9 / 7) / 1e9, 1};
    EXPECT_EQ(levels(made->mesh), expected);
    EXPECT_EQ(made->report.layers, 3);
    EXPECT_EQ(made->report.beside, 0);
    EXPECT_EQ(made->report.cells_after, 3 * made->report.cells_before);
    EXPECT_NEAR(made->report.first[0], 1.0 / 7, 1e-12);
    EXPECT_NEAR(made->report.growth[1], 2, 1e-9);
  }
}

TEST(SplitLayers, ConformAndKeepTheShapeOfBentCells) {
  for (const Shape shape : {Shape::Quadrilateral, Shape::Prism, Shape::Hexahedron})
    for (int order = 1; order <= 5; ++order)
      for (const LayerSpacing spacing : {LayerSpacing::Even, LayerSpacing::Graded}) {
        const HighOrderMesh mesh = bent(box(shape, 3, 2, 2), order);
        const auto made = split(mesh, geometric(4, 1.7, spacing));
        ASSERT_TRUE(made) << made.error().sentence;
        // Layers have the same share of each edge only if all are equally high.
        const Expected<void> checked = check_structure(made->mesh);
        EXPECT_TRUE(checked) << (checked ? "" : checked.error().sentence);
        EXPECT_NEAR(volume(made->mesh), volume(mesh), 2e-4 * volume(mesh)) << static_cast<int>(shape) << " " << order;
      }
}

/// With edges that are straight and divided alike, a part is the map of a part of the reference cell, so the
/// polynomials are the same.
TEST(SplitLayers, AreExactlyPartsOfTheirParents) {
  for (const Shape shape : {Shape::Quadrilateral, Shape::Prism, Shape::Hexahedron}) {
    HighOrderMesh mesh = *change_order(box(shape, 3, 1, 2), 4);
    for (std::size_t n = 0; n < mesh.node_count(); ++n) {
      double* x = &mesh.coordinates[3 * n];
      x[1] += 0.1 * std::sin(5 * x[0] + 3 * x[2]);  // the columns move as they are
    }
    const auto made = split(mesh, geometric(4, 1.5));
    ASSERT_TRUE(made) << made.error().sentence;
    expect_whole(mesh, made->mesh);
  }
}

TEST(SplitLayers, LeaveNodesAndNumbersThatAreNotSplit) {
  const HighOrderMesh mesh = bent(box(Shape::Prism, 3, 2, 2), 3);
  const auto made = split(mesh, geometric(5, 1.5));
  ASSERT_TRUE(made);
  std::map<std::int64_t, std::size_t> place;
  for (std::size_t n = 0; n < made->mesh.node_count(); ++n) place[made->mesh.node_numbers[n]] = n;
  std::set<std::int32_t> wall;
  for (const ElementBlock& block : mesh.blocks)
    if (block.entity == 7 && reference::info(block.shape).dimension == 2)
      wall.insert(block.nodes.begin(), block.nodes.end());
  ASSERT_FALSE(wall.empty());
  for (const std::int32_t node : wall) {
    const auto found = place.find(mesh.node_numbers[at(node)]);
    ASSERT_NE(found, place.end());
    for (std::size_t c = 0; c < 3; ++c)
      EXPECT_EQ(made->mesh.coordinates[3 * found->second + c], mesh.coordinates[3 * at(node) + c]);
  }
  std::set<std::int64_t> numbers(made->mesh.node_numbers.begin(), made->mesh.node_numbers.end());
  EXPECT_EQ(numbers.size(), made->mesh.node_count());
  EXPECT_EQ(count(made->mesh, Shape::Triangle), count(mesh, Shape::Triangle));
  EXPECT_EQ(made->report.cells_after, 6 * made->report.cells_before / 2);
}

/// The last wall element is in the middle of the plate. Quadrilaterals beside it are split to the end of the mesh.
TEST(SplitLayers, GoOnThroughQuadrilateralsWhereTheWallStops) {
  const auto tag_of = [](const Place& x) { return x[1] < 1e-9 && x[0] < 0.5 ? 7 : 8; };
  const HighOrderMesh mesh = bent(box(Shape::Quadrilateral, 4, 2, 1, tag_of), 3);
  const auto made = split(mesh, geometric(4, 1.5));
  ASSERT_TRUE(made);
  EXPECT_EQ(made->report.split, 4);
  EXPECT_EQ(made->report.beside, 2);
  EXPECT_TRUE(check_structure(made->mesh));
}

/// A wall in a concave corner: the cell there is split in both directions.
TEST(SplitLayers, CrossInAConcaveCorner) {
  const auto tag_of = [](const Place& x) { return x[1] < 1e-9 || x[0] < 1e-9 ? 7 : 8; };
  for (const Shape shape : {Shape::Quadrilateral, Shape::Hexahedron}) {
    const HighOrderMesh mesh = bent(box(shape, 3, 3, 2, tag_of), 3);
    const auto made = split(mesh, geometric(4, 1.5));
    ASSERT_TRUE(made) << made.error().sentence;
    const std::size_t rows = shape == Shape::Hexahedron ? 2 : 1;
    EXPECT_EQ(count(made->mesh, shape) - (rows == 1 ? 0 : 0), rows * (16 + 2 * 2 * 4 + 4));
    EXPECT_TRUE(check_structure(made->mesh));
    EXPECT_NEAR(volume(made->mesh), volume(mesh), 2e-4);
  }
}

TEST(SplitLayers, MeetBetweenTwoWalls) {
  const auto tag_of = [](const Place& x) { return x[1] < 1e-9 || x[1] > 1 - 1e-9 ? 7 : 8; };
  const auto made = split(box(Shape::Hexahedron, 3, 1, 2, tag_of), geometric(2, 3));
  ASSERT_TRUE(made) << made.error().sentence;
  EXPECT_EQ(levels(made->mesh), (std::set<double>{0, 0.125, 0.5, 0.875, 1}));
  LayerOptions given = geometric(0, 0);
  given.heights = {0.1, 0.2};
  const auto left = split(box(Shape::Hexahedron, 3, 1, 2, tag_of), given);
  ASSERT_TRUE(left) << left.error().sentence;
  EXPECT_EQ(levels(left->mesh), (std::set<double>{0, 0.1, 0.3, 0.7, 0.9, 1}));
  EXPECT_TRUE(left->report.leaves_cells);
}

/// At the end of the layers stand a pyramid and tetrahedra, which become fans round their other vertices.
TEST(SplitLayers, EndAtPyramidsAndTetrahedra) {
  const std::vector<Place> places{{0, 0, 0}, {1, 0, 0}, {1, 1, 0},     {0, 1, 0},    {0, 0, 1},  {1, 0, 1},
                                  {1, 1, 1}, {0, 1, 1}, {2, 0.5, 0.5}, {2, 0.5, -1}, {2, 0.5, 2}};
  // The cut edges are those along y: 1–2, 5–6 belong to the pyramid, and each to one tetrahedron.
  const std::vector<SmallCell> cells{{Shape::Hexahedron, {0, 1, 2, 3, 4, 5, 6, 7}},
                                     {Shape::Pyramid, {1, 2, 6, 5, 8}},
                                     {Shape::Tetrahedron, {1, 2, 8, 9}},
                                     {Shape::Tetrahedron, {6, 5, 8, 10}}};
  for (int order = 1; order <= 4; ++order) {
    const HighOrderMesh mesh =
        bent(small_mesh(places, cells, [](const Place& x) { return x[1] < 1e-9 && x[0] < 1 ? 7 : 8; }), order, 0.02);
    ASSERT_TRUE(check_structure(mesh)) << check_structure(mesh).error().sentence;
    for (const LayerSpacing spacing : {LayerSpacing::Even, LayerSpacing::Graded}) {
      const auto made = split(mesh, geometric(5, 1.5, spacing));
      ASSERT_TRUE(made) << made.error().sentence;
      EXPECT_EQ(made->report.beside, 3);
      EXPECT_EQ(count(made->mesh, Shape::Pyramid), 5U);
      EXPECT_EQ(count(made->mesh, Shape::Tetrahedron), 10U);
      const Expected<void> checked = check_structure(made->mesh);
      EXPECT_TRUE(checked) << (checked ? "" : checked.error().sentence);
      EXPECT_NEAR(volume(made->mesh), volume(mesh), 2e-4 * volume(mesh));
    }
  }
}

/// The wall ends at a prism that stands on a quadrilateral: it becomes a fan, as its triangles do.
TEST(SplitLayers, EndAtPrismsThatStandOnAQuadrilateral) {
  const std::vector<Place> places{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},   {0, 0, 1},
                                  {1, 0, 1}, {1, 1, 1}, {0, 1, 1}, {2, 0.5, 0}, {2, 0.5, 1}};
  const std::vector<SmallCell> cells{{Shape::Hexahedron, {0, 1, 2, 3, 4, 5, 6, 7}}, {Shape::Prism, {1, 8, 2, 5, 9, 6}}};
  for (int order = 1; order <= 4; ++order) {
    const HighOrderMesh mesh =
        bent(small_mesh(places, cells, [](const Place& x) { return x[1] < 1e-9 && x[0] < 1 ? 7 : 8; }), order, 0.02);
    const auto made = split(mesh, geometric(5, 1.5));
    ASSERT_TRUE(made) << made.error().sentence;
    EXPECT_EQ(count(made->mesh, Shape::Prism), 5U);
    EXPECT_TRUE(check_structure(made->mesh));
    EXPECT_NEAR(volume(made->mesh), volume(mesh), 2e-4 * volume(mesh));
  }
}

TEST(SplitLayers, MoveThePartnersOfPeriodicNodes) {
  HighOrderMesh mesh = *change_order(box(Shape::Quadrilateral, 3, 2, 1,
                                         [](const Place& x) {
                                           return x[1] < 1e-9 ? 7 : x[0] < 1e-9 ? 5 : x[0] > 1 - 1e-9 ? 6 : 8;
                                         }),
                                     3);
  PeriodicLink link;
  link.dimension = 1;
  link.entity = 6;
  link.master = 5;
  const auto x_of = [&](std::size_t n) { return mesh.coordinates[3 * n]; };
  for (std::size_t a = 0; a < mesh.node_count(); ++a)
    for (std::size_t b = 0; b < mesh.node_count(); ++b)
      if (x_of(a) > 1 - 1e-9 && x_of(b) < 1e-9 &&
          std::abs(mesh.coordinates[3 * a + 1] - mesh.coordinates[3 * b + 1]) < 1e-9)
        link.nodes.emplace_back(a, b);
  mesh.periodic = {link};
  const auto made = split(mesh, geometric(4, 1.5));
  ASSERT_TRUE(made);
  ASSERT_EQ(made->mesh.periodic.size(), 1U);
  EXPECT_EQ(made->mesh.periodic[0].nodes.size(), static_cast<std::size_t>(5 * 3 + 1));
  for (const auto& [node, master] : made->mesh.periodic[0].nodes)
    EXPECT_NEAR(made->mesh.coordinates[3 * at(node) + 1], made->mesh.coordinates[3 * at(master) + 1], 1e-13);
}

TEST(SplitLayers, OfSeveralRowsBeginAndEndWhereRowsDo) {
  LayerOptions wanted = geometric(6, 1.5);
  wanted.rows = 2;
  const HighOrderMesh mesh = bent(box(Shape::Prism, 3, 3, 2), 2);
  const auto made = split(mesh, wanted);
  ASSERT_TRUE(made) << made.error().sentence;
  EXPECT_EQ(made->report.cells_after, made->report.cells_before * (6 + 1) / 3);
  EXPECT_GT(made->report.stretched, 0);
  EXPECT_TRUE(check_structure(made->mesh));
}

TEST(SplitLayers, AreTheSameWithAnyNumberOfThreads) {
  const HighOrderMesh mesh = bent(box(Shape::Prism, 5, 2, 4), 3);
  const auto one = split(mesh, geometric(7, 1.4, LayerSpacing::Graded), 1);
  const auto three = split(mesh, geometric(7, 1.4, LayerSpacing::Graded), 3);
  ASSERT_TRUE(one && three);
  EXPECT_EQ(one->mesh.coordinates, three->mesh.coordinates);
}

/// A sheet that is rolled up by 360°. Layers along it turn by 120° each, so with straight sides they are inverted. Its
/// ends have no normal that layers could follow, so they take the same share of each edge.
TEST(SplitLayers, FollowASpiral) {
  for (const Shape shape : {Shape::Quadrilateral, Shape::Hexahedron})
    for (const int layers : {2, 3, 4, 7}) {
      HighOrderMesh mesh = *change_order(box(shape, 1, 1), 9);
      for (std::size_t n = 0; n < mesh.node_count(); ++n) {
        double* x = &mesh.coordinates[3 * n];
        const double angle = 2 * std::numbers::pi * x[1], radius = 1 + 0.5 * x[1] - 0.3 * x[0];
        x[0] = -radius * std::cos(angle);
        x[1] = radius * std::sin(angle);
      }
      ASSERT_EQ(quality(mesh).certified.valid, 1);
      const auto made = split(mesh, geometric(layers, 1.2, LayerSpacing::Graded));
      ASSERT_TRUE(made) << made.error().sentence;
      EXPECT_EQ(quality(made->mesh).certified.valid, layers);
    }
}

TEST(SplitLayers, LieInThePlaneOfTheirMesh) {
  HighOrderMesh mesh = bent(box(Shape::Quadrilateral, 3, 2), 3);
  for (std::size_t n = 0; n < mesh.node_count(); ++n) {
    double* x = &mesh.coordinates[3 * n];
    std::swap(x[1], x[2]);
    x[1] = 5;
  }
  const Team team(1);
  const auto checked = check_mesh(mesh, CheckFor::Optimising, team);
  ASSERT_TRUE(checked);
  const auto made = split_layers(*checked, geometric(4, 1.5), team);
  ASSERT_TRUE(made) << made.error().sentence;
  for (std::size_t n = 0; n < made->mesh.node_count(); ++n) EXPECT_EQ(made->mesh.coordinates[3 * n + 1], 5);
  EXPECT_EQ(made->report.cells_after, 3 * 4 + 3);
}

TEST(SplitLayers, RefuseWhatTheyCannotDo) {
  const auto sentence = [](const HighOrderMesh& mesh, const LayerOptions& wanted) {
    const auto made = split(mesh, wanted);
    return made ? std::string() : made.error().sentence;
  };
  const HighOrderMesh quads = box(Shape::Quadrilateral, 3, 2);
  LayerOptions unknown = geometric(3, 2);
  unknown.walls = {"wing"};
  EXPECT_EQ(sentence(quads, unknown), "There is no wall 'wing'. The boundary elements of the mesh have the tags 7, 8.");
  LayerOptions high = geometric(3, 0);
  high.first = 0.2;
  EXPECT_EQ(
      sentence(quads, high),
      "The layers do not fit at node 1 of the wall: the cells are 0.5 high there. Give fewer or lower layers, or a "
      "thicker row of cells.");
  LayerOptions rows = geometric(3, 2);
  rows.rows = 3;
  EXPECT_EQ(sentence(quads, rows).substr(0, 55), "There are only 2 rows of cells above the wall, at eleme");
  const std::vector<Place> places{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
  const HighOrderMesh triangles = small_mesh(places, {{Shape::Triangle, {0, 1, 2}}, {Shape::Triangle, {1, 3, 2}}},
                                             [](const Place& x) { return x[1] < 1e-9 ? 7 : 8; });
  EXPECT_EQ(sentence(triangles, geometric(3, 2)).substr(0, 41), "At the wall lies element 1, a triangle. L");
  const HighOrderMesh mixed = small_mesh({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5, 2, 0}},
                                         {{Shape::Quadrilateral, {0, 1, 2, 3}}, {Shape::Triangle, {3, 2, 4}}},
                                         [](const Place& x) { return x[1] < 1e-9 ? 7 : 8; });
  rows.rows = 2;
  EXPECT_NE(sentence(mixed, rows).find("Row 2 above the wall has element"), std::string::npos);
}

}  // namespace
}  // namespace varimesh
