// The table of node orders: each lists every node of every cell once, and knows where its format's authors describe it.
#include "core/formats/numbering/node_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "core/formats/mfem/topology.h"
#include "core/reference/nodes.h"
#include "tests/core/support/print.h"

namespace varimesh::formats {
namespace {

constexpr std::array kShapes = {Shape::Line,    Shape::Triangle, Shape::Quadrilateral, Shape::Tetrahedron,
                                Shape::Pyramid, Shape::Prism,    Shape::Hexahedron};

/// VTK's file has pyramids of order 2 and above as hexahedra.
bool has_cell(NodeOrder node_order, Shape shape, int order) {
  return node_order != NodeOrder::Vtk || shape != Shape::Pyramid || order == 1;
}

TEST(NodeOrders, ListEveryNodeOfEveryCellOnce) {
  for (const NodeOrderEntry& entry : node_orders())
    for (const Shape shape : kShapes)
      for (int order = 1; order <= kMaxOrder; ++order) {
        if (!has_cell(entry.order, shape, order)) continue;
        std::set<Position> wanted;
        for (const auto& at : reference::lattice(shape, order)) wanted.insert({at[0], at[1], at[2]});
        const Positions& positions = node_positions(entry.order, shape, order);
        EXPECT_EQ(std::set<Position>(positions.begin(), positions.end()), wanted)
            << entry.name << ", " << reference::info(shape).name << " of order " << order;
        EXPECT_EQ(positions.size(), wanted.size());
      }
}

TEST(NodeOrders, ConvertToGmshsNodesAtTheSamePositions) {
  for (const NodeOrderEntry& entry : node_orders())
    for (const Shape shape : kShapes)
      for (int order = 1; order <= 5; ++order) {
        if (!has_cell(entry.order, shape, order)) continue;
        const std::vector<int>& nodes = gmsh_nodes(entry.order, shape, order);
        const auto& lattice = reference::lattice(shape, order);
        const Positions& positions = node_positions(entry.order, shape, order);
        for (std::size_t i = 0; i < nodes.size(); ++i)
          for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(positions[i][k], lattice[std::size_t(nodes[i])][k]);
      }
}

TEST(NodeOrders, HaveNamesAndSources) {
  std::set<std::string_view> names;
  for (const NodeOrderEntry& entry : node_orders()) {
    EXPECT_TRUE(names.insert(entry.name).second) << entry.name;
    EXPECT_GT(entry.source.size(), 20U) << entry.name;
  }
  EXPECT_EQ(names.size(), 8U);
}

// Spelled out from MFEM's documentation, not from the table.
TEST(NodeOrders, AreThoseOfTheDocumentationForSmallCells) {
  const Positions square{{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}, {1, 0, 0},
                         {2, 1, 0}, {1, 2, 0}, {0, 1, 0}, {1, 1, 0}};
  EXPECT_EQ(node_positions(NodeOrder::Mfem, Shape::Quadrilateral, 2), square);
  const Positions triangle{{0, 0, 0}, {3, 0, 0}, {0, 3, 0}, {1, 0, 0}, {2, 0, 0},
                           {2, 1, 0}, {1, 2, 0}, {0, 2, 0}, {0, 1, 0}, {1, 1, 0}};
  EXPECT_EQ(node_positions(NodeOrder::Mfem, Shape::Triangle, 3), triangle);
  const Positions prism{{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 2}, {2, 0, 2}, {0, 2, 2},
                        {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {1, 0, 2}, {1, 1, 2}, {0, 1, 2},
                        {0, 0, 1}, {2, 0, 1}, {0, 2, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
  EXPECT_EQ(node_positions(NodeOrder::Mfem, Shape::Prism, 2), prism);
  const Positions rows{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0, 2, 0}};
  EXPECT_EQ(node_positions(NodeOrder::Rows, Shape::Triangle, 2), rows);
}

TEST(MfemTopology, HasTheEdgesAndFacesOfTheShapes) {
  for (const Shape shape : kShapes) {
    const reference::ShapeInfo& cell = reference::info(shape);
    std::set<std::set<int>> own, mfem;
    for (const auto& [a, b] : cell.edges) own.insert({a, b});
    for (const auto& [a, b] : edges_of(Sides::Mfem, shape)) mfem.insert({a, b});
    EXPECT_EQ(own, mfem) << cell.name;
    if (cell.dimension < 3) continue;
    own.clear();
    mfem.clear();
    for (const auto& face : cell.faces) own.insert({face.vertices.begin(), face.vertices.end()});
    for (const auto& face : faces_of(Sides::Mfem, shape)) mfem.insert({face.vertices.begin(), face.vertices.end()});
    EXPECT_EQ(own, mfem) << cell.name;
  }
}

// Two hexahedra with a common face, which the second numbers from another corner: both find the same nodes on it.
TEST(MfemTopology, GivesNeighboursTheSameNodes) {
  const std::array<std::int32_t, 8> first{0, 1, 2, 3, 4, 5, 6, 7}, second{5, 1, 8, 9, 6, 2, 10, 11};
  const auto visit = [&](std::size_t begin, std::size_t end, const TopologyCells::Body& body) {
    for (std::size_t cell = begin; cell < end; ++cell) body(cell, Shape::Hexahedron, cell == 0 ? first : second);
  };
  const MfemTopology topology(3, 4, 12, {2, visit}, Team(1));
  EXPECT_EQ(topology.edge_count(), 20);
  EXPECT_EQ(topology.face_count(), 11);
  const auto inside = std::int32_t(topology.interior_first());
  EXPECT_EQ(inside, 12 + 20 * 3 + 11 * 9);
  std::array<std::vector<std::int32_t>, 2> nodes;
  for (auto& each : nodes) each.resize(125);
  ASSERT_TRUE(topology.find_nodes(Shape::Hexahedron, first, inside, nodes[0]));
  ASSERT_TRUE(topology.find_nodes(Shape::Hexahedron, second, inside + 27, nodes[1]));
  std::vector<std::int32_t> a = nodes[0], b = nodes[1], common;
  std::sort(a.begin(), a.end());
  std::sort(b.begin(), b.end());
  EXPECT_TRUE(std::adjacent_find(a.begin(), a.end()) == a.end());
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(common));
  EXPECT_EQ(common.size(), 25U) << "the nodes of one face";
  // Position (4, j, k) of the first is (k', ...) of the second: its face is 1 2 6 5, of the second 5 1 2 6 at j = 0.
  const std::vector<int>& at = nodes_by_position(Shape::Hexahedron, 4);
  for (std::size_t j = 0; j <= 4; ++j)
    for (std::size_t k = 0; k <= 4; ++k)
      EXPECT_EQ(nodes[0][std::size_t(at[4 + 5 * (j + 5 * k)])], nodes[1][std::size_t(at[(4 - k) + 5 * (0 + 5 * j)])]);
}

}  // namespace
}  // namespace varimesh::formats
