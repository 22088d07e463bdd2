// Every fault that a mesh can have is found and named.
#include "core/mesh/check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include "core/formats/formats.h"
#include "core/mesh/connectivity.h"
#include "core/reference/nodes.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

// A mesh of linear cells from vertex lists. Elements and nodes are numbered from 1.
HighOrderMesh linear(std::vector<double> coordinates, std::vector<std::pair<Shape, std::vector<std::int32_t>>> cells) {
  HighOrderMesh mesh;
  mesh.coordinates = std::move(coordinates);
  for (std::size_t i = 0; i < mesh.node_count(); ++i) mesh.node_numbers.push_back(std::int64_t(i) + 1);
  mesh.node_blocks.push_back({-1, 0, 0, std::int32_t(mesh.node_count())});
  mesh.order = 1;
  std::int64_t number = 0;
  for (auto& [shape, nodes] : cells) {
    mesh.dimension = std::max(mesh.dimension, reference::info(shape).dimension);
    mesh.blocks.push_back({shape, 1, 1, {}, {++number}, std::move(nodes), {}, {}});
  }
  return mesh;
}

HighOrderMesh read_case(const std::string& name) {
  auto file = formats::read_file(test::source_file("tests/cases/" + name));
  EXPECT_TRUE(file) << file.error().sentence;
  return file ? file->mesh : HighOrderMesh{};
}

#define EXPECT_REFUSED(mesh, words)                                                                 \
  do {                                                                                              \
    const auto checked = check_structure(mesh);                                                     \
    ASSERT_FALSE(checked);                                                                          \
    EXPECT_EQ(checked.error().kind, Error::Kind::BadInput);                                         \
    EXPECT_NE(checked.error().sentence.find(words), std::string::npos) << checked.error().sentence; \
  } while (false)

const std::vector<double> kSquare = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
const std::vector<double> kCube = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1};

TEST(CheckCounts, RefusesMoreThan32BitsCanNumber) {
  EXPECT_TRUE(check_counts(2'147'483'647, 268'435'455));
  const auto nodes = check_counts(2'147'483'648, 1);
  ASSERT_FALSE(nodes);
  EXPECT_NE(nodes.error().sentence.find("2147483648 nodes, but can have at most 2147483647"), std::string::npos);
  const auto cells = check_counts(1, 268'435'456);
  ASSERT_FALSE(cells);
  EXPECT_NE(cells.error().sentence.find("268435456 cells, but can have at most 268435455"), std::string::npos);
}

TEST(CheckMesh, AcceptsTheCases) {
  for (const char* name : {"nine_triangles.msh", "circle_p5.msh", "aerofoil_p4.msh", "annulus_p3.msh", "sphere_p3.msh",
                           "cylinder_p2.msh"}) {
    const auto checked = check_structure(read_case(name));
    ASSERT_TRUE(checked) << name << ": " << checked.error().sentence;
  }
}

TEST(CheckMesh, AcceptsEveryShapeAtEveryOrder) {
  for (Shape shape :
       {Shape::Triangle, Shape::Quadrilateral, Shape::Tetrahedron, Shape::Pyramid, Shape::Prism, Shape::Hexahedron})
    for (int order = 2; order <= 10; ++order) {
      const auto checked = check_structure(test::one_cell(shape, order));
      EXPECT_TRUE(checked) << checked.error().sentence;
    }
}

TEST(CheckMesh, AcceptsAMeshThatIsClockwiseThroughoutAndOneInAnotherPlane) {
  HighOrderMesh mesh = read_case("nine_triangles.msh");
  for (std::size_t i = 0; i < mesh.node_count(); ++i) {
    mesh.coordinates[3 * i] *= -1;
    mesh.coordinates[3 * i + 2] = 0.3;
  }
  const auto checked = check_structure(mesh);
  ASSERT_TRUE(checked) << checked.error().sentence;
}

// === Kind ================================================================================================

TEST(CheckMesh, EmptyMesh) {
  EXPECT_REFUSED(HighOrderMesh{}, "empty");
  EXPECT_REFUSED(linear(kSquare, {}), "empty");
}

TEST(CheckMesh, OneDimensionalMesh) {
  EXPECT_REFUSED(linear(kSquare, {{Shape::Line, {0, 1}}, {Shape::Line, {1, 2}}}), "dimension 1");
}

TEST(CheckMesh, ANodeOfNoCellMayLieOutsideThePlane) {
  // A point element, as gmsh writes the centre of an arc.
  const auto checked =
      check_structure(linear({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 5},
                             {{Shape::Triangle, {0, 1, 2}}, {Shape::Triangle, {0, 2, 3}}, {Shape::Point, {4}}}));
  EXPECT_TRUE(checked) << checked.error().sentence;
}

TEST(CheckMesh, SurfaceInSpace) {
  EXPECT_REFUSED(
      linear({0, 0, 0, 1, 0, 0, 1, 1, 1, 0, 1, 0}, {{Shape::Triangle, {0, 1, 2}}, {Shape::Triangle, {0, 2, 3}}}),
      "only the quality of the mesh can be judged");
}

TEST(CheckMesh, ASurfaceInSpaceMayBeJudged) {
  const std::vector<double> corner = {0, 0, 0, 1, 0, 0, 1, 1, 1, 0, 1, 0};
  const auto surface = linear(corner, {{Shape::Triangle, {0, 1, 2}}, {Shape::Triangle, {0, 3, 2}}});
  EXPECT_TRUE(is_surface(surface));
  EXPECT_TRUE(check_judgeable(surface));
  std::vector<double> fin = corner;
  fin.insert(fin.end(), {0, 0, 1});
  EXPECT_TRUE(check_judgeable(
      linear(fin, {{Shape::Triangle, {0, 1, 2}}, {Shape::Triangle, {0, 2, 3}}, {Shape::Triangle, {0, 2, 4}}})))
      << "three walls may meet at an edge";
  const auto twice = check_judgeable(linear(corner, {{Shape::Triangle, {0, 1, 2}}, {Shape::Triangle, {2, 0, 1}}}));
  ASSERT_FALSE(twice);
  EXPECT_NE(twice.error().sentence.find("are the same triangle"), std::string::npos);
}

TEST(CheckMesh, AMeshInThePlaneIsNoSurfaceInSpace) {
  const auto flat = linear(kSquare, {{Shape::Triangle, {0, 1, 2}}, {Shape::Triangle, {0, 2, 3}}});
  EXPECT_FALSE(is_surface(flat));
  EXPECT_TRUE(check_judgeable(flat));
  const auto fan = linear({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, -1, 0, 1, 1, 0},
                          {{Shape::Triangle, {0, 1, 2}}, {Shape::Triangle, {0, 1, 3}}, {Shape::Triangle, {0, 1, 4}}});
  EXPECT_FALSE(check_judgeable(fan)) << "three cells at an edge";
  EXPECT_FALSE(is_surface(linear(kCube, {{Shape::Hexahedron, {0, 1, 2, 3, 4, 5, 6, 7}}})));
}

/// A ring between radii 1 and 2 of two quadrilaterals, which share all four vertices.
HighOrderMesh ring_of_two(int order) {
  HighOrderMesh mesh;
  mesh.dimension = 2;
  mesh.order = order;
  const auto& lattice = reference::lattice(Shape::Quadrilateral, order);
  // By angle and radius, in steps of the lattice.
  std::map<std::pair<int, int>, std::int32_t> nodes;
  for (int half = 0; half < 2; ++half) {
    ElementBlock& block =
        mesh.blocks.emplace_back(ElementBlock{Shape::Quadrilateral, order, 1, {}, {half + 1}, {}, {}, {}});
    for (const auto& at : lattice) {
      const int angle = (half * order + at[1]) % (2 * order);
      const auto [place, is_new] = nodes.try_emplace({angle, at[0]}, std::int32_t(mesh.node_count()));
      if (is_new) {
        const double radius = 1 + double(at[0]) / order, turn = std::numbers::pi * angle / order;
        mesh.coordinates.insert(mesh.coordinates.end(), {radius * std::cos(turn), radius * std::sin(turn), 0});
        mesh.node_numbers.push_back(std::int64_t(mesh.node_count()));
      }
      block.nodes.push_back(place->second);
    }
  }
  mesh.node_blocks = {{-1, 0, 0, std::int32_t(mesh.node_count())}};
  return mesh;
}

TEST(CheckMesh, TwoCellsMayHaveTheSameVertices) {
  HighOrderMesh ring = ring_of_two(4);
  const auto checked = check_structure(ring);
  EXPECT_TRUE(checked) << checked.error().sentence;
  const Facets found = facets(ring);
  EXPECT_EQ(std::ranges::count_if(found.neighbour, [](std::int32_t n) { return n >= 0; }), 4)
      << "two edges of two cells";
  // Boundary elements belong to the halves that have their nodes.
  for (int half = 0; half < 2; ++half) {
    ElementBlock& arc = ring.blocks.emplace_back(ElementBlock{Shape::Line, 4, half + 1, {}, {10 + half}, {}, {}, {}});
    for (const int local : reference::facet_nodes(Shape::Quadrilateral, 4, 1))
      arc.nodes.push_back(ring.blocks[std::size_t(half)].nodes[std::size_t(local)]);
  }
  EXPECT_TRUE(check_structure(ring));
  EXPECT_EQ(facets(ring).elements, (std::vector<std::pair<std::int32_t, std::int32_t>>{{1, 0}, {5, 1}}));
  ring.blocks[1].nodes = ring.blocks[0].nodes;
  EXPECT_REFUSED(ring, "are the same quadrilateral");
}

TEST(CheckMesh, MixedOrdersOfCellsAndOfBoundaryElements) {
  HighOrderMesh mesh = test::one_cell(Shape::Quadrilateral, 3);
  ElementBlock linear_cell{Shape::Triangle, 1, 1, {}, {99}, {0, 1, 2}, {}, {}};
  mesh.blocks.push_back(linear_cell);
  EXPECT_REFUSED(mesh, "element 99 (triangle) has order 1");
  mesh.blocks.back() = {Shape::Line, 1, 1, {}, {98}, {0, 1}, {}, {}};
  EXPECT_REFUSED(mesh, "element 98 (line) has order 1");
}

// === Single elements =====================================================================================

TEST(CheckMesh, NotANumber) {
  HighOrderMesh mesh = read_case("nine_triangles.msh");
  mesh.coordinates[3 * 40 + 1] = std::nan("");
  EXPECT_REFUSED(mesh, "Node 41 ");
  mesh.coordinates[3 * 20] = INFINITY;
  EXPECT_REFUSED(mesh, "Node 21 has a coordinate that is not a finite number (2 such nodes in all)");
}

TEST(CheckMesh, TooLarge) {
  HighOrderMesh mesh = read_case("nine_triangles.msh");
  mesh.coordinates[3 * 40 + 1] = 1e50;
  EXPECT_TRUE(check_structure(mesh));
  mesh.coordinates[3 * 20] = -1e308;
  EXPECT_REFUSED(mesh, "Node 21 has a coordinate that is beyond 1e50");
}

TEST(CheckMesh, IndexOutOfRange) {
  HighOrderMesh mesh = read_case("nine_triangles.msh");
  mesh.blocks[1].nodes[17] = 87;
  EXPECT_REFUSED(mesh, "Element 9 refers to node index 87");
}

TEST(CheckMesh, SameNodeTwiceInOneElement) {
  HighOrderMesh mesh = read_case("nine_triangles.msh");
  mesh.blocks[1].nodes[14] = mesh.blocks[1].nodes[13];
  EXPECT_REFUSED(mesh, "Element 8 (triangle) has node");
}

TEST(CheckMesh, AcceptsCellsThatAreInvertedOrFlatWithStraightSides) {
  const std::pair<std::vector<double>, std::pair<Shape, std::vector<std::int32_t>>> cells[] = {
      {{0, 0, 0, 1, 0, 0, 1, 1, 0}, {Shape::Triangle, {2, 1, 0}}},
      {{0, 0, 0, 1, 0, 0, 0, 1, 0, 0.3, 0.3, 0}, {Shape::Tetrahedron, {0, 1, 2, 3}}},
      {{0, 0, 0, 1, 0, 0, 0.2, 0.2, 0, 0, 1, 0}, {Shape::Quadrilateral, {0, 1, 2, 3}}},
      {kCube, {Shape::Hexahedron, {0, 1, 2, 3, 5, 4, 7, 6}}}};
  for (const auto& [coordinates, cell] : cells) {
    const auto checked = check_structure(linear(coordinates, {cell}));
    EXPECT_TRUE(checked) << checked.error().sentence;
  }
}

// === Neighbours ==========================================================================================

TEST(CheckMesh, DuplicateElements) {
  EXPECT_REFUSED(
      linear(kSquare, {{Shape::Triangle, {0, 1, 2}}, {Shape::Triangle, {0, 2, 3}}, {Shape::Triangle, {2, 3, 0}}}),
      "Elements 2 and 3 are the same triangle; remove");
}

TEST(CheckMesh, ThreeCellsAtOneFacet) {
  std::vector<double> x = kSquare;
  x.insert(x.end(), {0.2, 0.9, 0});
  EXPECT_REFUSED(linear(x, {{Shape::Triangle, {0, 1, 2}}, {Shape::Triangle, {0, 2, 3}}, {Shape::Triangle, {0, 2, 4}}}),
                 "Element 1 and at least two others share the edge of nodes");
}

TEST(CheckMesh, NeighboursWithOtherNodesOnTheirEdge) {
  HighOrderMesh mesh = read_case("nine_triangles.msh");
  // The edge B–M of the first triangle (its second edge) gets a middle node of its own.
  const std::int32_t shared = mesh.blocks[1].nodes[3 + 3 + 1];
  const auto fresh = std::int32_t(mesh.node_count());
  for (std::size_t k = 0; k < 3; ++k) mesh.coordinates.push_back(mesh.coordinates[3 * std::size_t(shared) + k]);
  mesh.node_numbers.push_back(1000);
  mesh.blocks[1].nodes[3 + 3 + 1] = fresh;
  EXPECT_REFUSED(mesh, "Elements 8 and 9 disagree on the edge");
}

TEST(CheckMesh, NeighboursWithTheirEdgesNodesInTheSameDirection) {
  HighOrderMesh mesh = read_case("nine_triangles.msh");
  std::swap(mesh.blocks[1].nodes[6], mesh.blocks[1].nodes[8]);
  EXPECT_REFUSED(mesh, "Elements 8 and 9 disagree on the edge");
}

TEST(CheckMesh, FacesWithNodesInAnotherOrder) {
  // Neighbouring tetrahedra must have the nodes of their common face in one order.
  HighOrderMesh mesh = read_case("sphere_p3.msh");
  const Facets around = facets(mesh);
  const Cells cells(mesh, 3);
  std::size_t cell = 0;
  while (around.neighbour[std::size_t(around.first[cell])] < 0) ++cell;
  auto* nodes = const_cast<std::int32_t*>(cells.nodes(cell).data());
  std::swap(nodes[4], nodes[5]);  // the two nodes inside the first edge
  EXPECT_REFUSED(mesh, "disagree on the face of nodes");
}

TEST(CheckMesh, BoundaryElementWithOtherNodes) {
  HighOrderMesh mesh = read_case("nine_triangles.msh");
  std::swap(mesh.blocks[0].nodes[2], mesh.blocks[0].nodes[4]);
  EXPECT_REFUSED(mesh, "Elements 8 and 1 disagree on the edge");
}

TEST(CheckMesh, QuadrilateralFaceAgainstTriangularOnes) {
  std::vector<double> x = kCube;
  x.insert(x.end(), {0.5, 0.5, 2});
  EXPECT_TRUE(
      check_structure(linear(x, {{Shape::Hexahedron, {0, 1, 2, 3, 4, 5, 6, 7}}, {Shape::Pyramid, {4, 5, 6, 7, 8}}})));
  EXPECT_REFUSED(linear(x, {{Shape::Hexahedron, {0, 1, 2, 3, 4, 5, 6, 7}},
                            {Shape::Tetrahedron, {4, 5, 6, 8}},
                            {Shape::Tetrahedron, {4, 6, 7, 8}}}),
                 " do not conform: a triangular face");
}

TEST(CheckMesh, NumbersThatLeaveNoneForNewNodesAndElements) {
  for (const std::int64_t largest : {std::numeric_limits<std::int64_t>::max(), std::numeric_limits<std::int64_t>::min(),
                                     (std::int64_t{1} << 62) + 1}) {
    HighOrderMesh mesh = test::one_cell(Shape::Tetrahedron, 2);
    mesh.node_numbers.back() = largest;
    EXPECT_REFUSED(mesh, "Node " + std::to_string(largest) + " has a number beyond 2^62");
    mesh = test::one_cell(Shape::Tetrahedron, 2);
    mesh.blocks[0].numbers[0] = largest;
    EXPECT_REFUSED(mesh, "Element " + std::to_string(largest) + " has a number beyond 2^62");
  }
  HighOrderMesh mesh = test::one_cell(Shape::Tetrahedron, 2);
  mesh.node_numbers.back() = mesh.blocks[0].numbers[0] = std::int64_t{1} << 62;
  EXPECT_TRUE(check_structure(mesh));
}

TEST(CheckMesh, CellsThatMeetAlongAnEdgeOnly) {
  HighOrderMesh mesh = test::one_cell(Shape::Tetrahedron, 2);
  const auto base = std::int32_t(mesh.node_count());
  // A second tetrahedron on the edge of nodes 0 and 1, on the other side. First it has the edge's middle node, then
  // another.
  ElementBlock& block = mesh.blocks[0];
  const reference::Points& points = reference::nodes(Shape::Tetrahedron, 2, reference::NodeSet::Equispaced, 3);
  block.numbers.push_back(8);
  for (std::int32_t i = 0; i < 10; ++i) {
    const bool shared = i == 0 || i == 1 || i == 4;
    block.nodes.push_back(shared ? i : base + i);
  }
  for (Eigen::Index i = 0; i < 10; ++i) {
    mesh.coordinates.insert(mesh.coordinates.end(), {points(i, 0), -3 - points(i, 1), -3 - points(i, 2)});
    mesh.node_numbers.push_back(100 + i);
  }
  EXPECT_TRUE(check_structure(mesh)) << check_structure(mesh).error().sentence;
  block.nodes[10 + 4] = base + 4;
  EXPECT_REFUSED(mesh, "disagree on the edge of nodes");
}

}  // namespace
}  // namespace varimesh
