// Edges and faces are numbered once, as they are met, and every cell finds them in the direction of the first.
#include "core/mesh/topology.h"

#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <set>
#include <stdexcept>

#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using Vertices = std::vector<std::int32_t>;

/// The vertices of a face of a cell, in the cell's order.
Vertices vertices_of(const reference::Facet& face, std::span<const std::int32_t> nodes) {
  Vertices vertices;
  for (const std::int8_t v : face.vertices)
    if (v >= 0) vertices.push_back(nodes[std::size_t(v)]);
  return vertices;
}

/// Calls edge(cell, e, its ends) and face(cell, f, its vertices) for all cells in order.
template <class Edge, class Face>
void walk(const HighOrderMesh& mesh, const Edge& edge, const Face& face) {
  const Cells cells(mesh, mesh.dimension);
  for (std::size_t cell = 0; cell < cells.count(); ++cell) {
    const reference::ShapeInfo& info = reference::info(cells.shape(cell));
    const std::span<const std::int32_t> nodes = cells.nodes(cell);
    for (std::size_t e = 0; e < info.edges.size(); ++e)
      edge(cell, e, std::pair(nodes[std::size_t(info.edges[e][0])], nodes[std::size_t(info.edges[e][1])]));
    for (std::size_t f = 0; f < info.faces.size(); ++f) face(cell, f, vertices_of(info.faces[f], nodes));
  }
}

class OfEachFilling : public ::testing::TestWithParam<testing::Filling> {
 protected:
  HighOrderMesh mesh_ = testing::grid(GetParam(), {3, 3, 2}, 2);
};

// The plain way: maps from sets of vertices to numbers, in the order in which they are met.
TEST_P(OfEachFilling, NumbersThePartsAsTheyAreMet) {
  const Team team(3);
  std::optional<Topology> made;
  team.run([&] { made.emplace(topology(mesh_, Topology::Faces::Turned, team)); });
  const Topology& found = *made;
  std::map<std::set<std::int32_t>, std::int32_t> edges, faces;
  std::size_t cell_before = 0;
  const auto edge = [&](std::size_t cell, std::size_t e, std::pair<std::int32_t, std::int32_t> ends) {
    if (cell != cell_before || e == 0) {
      EXPECT_EQ(found.edges_before(cell), std::int32_t(edges.size()));
      EXPECT_EQ(found.faces_before(cell), std::int32_t(faces.size()));
    }
    cell_before = cell;
    const auto [at, is_new] = edges.try_emplace({ends.first, ends.second}, std::int32_t(edges.size()));
    EXPECT_EQ(found.edge(ends.first, ends.second), at->second);
    EXPECT_EQ(found.edge(ends.second, ends.first), at->second);
    EXPECT_EQ(found.is_first_edge(cell, e), is_new);
  };
  std::int64_t triangles = 0;
  const auto face = [&](std::size_t cell, std::size_t f, const Vertices& vertices) {
    const auto [at, is_new] = faces.try_emplace({vertices.begin(), vertices.end()}, std::int32_t(faces.size()));
    EXPECT_EQ(found.face(vertices), at->second);
    EXPECT_EQ(found.is_first_face(cell, f), is_new);
    EXPECT_TRUE(!is_new || found.triangles_before(at->second) == triangles);
    triangles += is_new && vertices.size() == 3 ? 1 : 0;
  };
  walk(mesh_, edge, face);
  EXPECT_EQ(found.edge_count(), std::int64_t(edges.size()));
  EXPECT_EQ(found.face_count(), std::int64_t(faces.size()));
  EXPECT_EQ(found.triangles_before(found.face_count()), triangles);
  EXPECT_EQ(found.has_triangles(), triangles > 0);
  EXPECT_EQ(found.edge(0, std::int32_t(mesh_.node_count()) - 1), -1);
}

TEST_P(OfEachFilling, FindsEveryFaceInTheDirectionOfItsFirstCell) {
  const Topology found = topology(mesh_, Topology::Faces::Turned);
  std::map<std::int32_t, Vertices> first;
  const auto face = [&](std::size_t, std::size_t, const Vertices& vertices) {
    const FaceAt at = found.find_face(vertices);
    ASSERT_GE(at.number, 0);
    const Vertices& own = first.try_emplace(at.number, vertices).first->second;
    const std::size_t count = vertices.size();
    for (std::size_t k = 0; k < count; ++k)
      EXPECT_EQ(own[k], vertices[(at.corner + (at.forward ? k : count - k)) % count]);
  };
  walk(
      mesh_, [](auto...) {}, face);
}

INSTANTIATE_TEST_SUITE_P(Topology, OfEachFilling, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& of) { return testing::name(of.param); });

TEST(Topology, HasNoFaceAlongADiagonal) {
  const HighOrderMesh mesh = testing::grid(testing::Filling::Hexahedra, {1, 1, 1}, 1);
  const Topology found = topology(mesh, Topology::Faces::Turned);
  const auto& face = reference::info(Shape::Hexahedron).faces[0];
  Vertices vertices = vertices_of(face, mesh.blocks.back().nodes);
  EXPECT_GE(found.find_face(vertices).number, 0);
  std::swap(vertices[0], vertices[1]);
  EXPECT_EQ(found.find_face(vertices).number, -1);
}

TEST(Topology, CountsItsMemoryAndStopsWhereTheCountThrows) {
  const HighOrderMesh mesh = testing::grid(testing::Filling::Tetrahedra, {4, 4, 4}, 1);
  const Cells cells(mesh, 3);
  const auto vertices_of = [](Shape, std::span<const std::int32_t> nodes) {
    std::array<std::int32_t, 8> vertices{};
    std::copy_n(nodes.begin(), 4, vertices.begin());
    return vertices;
  };
  const TopologyCells all = topology_cells(cells, vertices_of);
  std::int64_t now = 0, most = 0;
  const auto number = [&](const CountMemory& memory) {
    return Topology(kGmshParts, Topology::Faces::Turned, std::int32_t(mesh.node_count()), all, Team(1), memory);
  };
  const Topology whole = number([&](std::int64_t bytes) { most = std::max(most, now += bytes); });
  EXPECT_GE(now, 12 * (whole.edge_count() + whole.face_count()));
  EXPECT_GT(most, now);
  std::int64_t left = most - 1;
  const auto refuse = [&](std::int64_t bytes) {
    if ((left -= bytes) < 0) throw std::length_error("full");
  };
  EXPECT_THROW(number(refuse), std::length_error);
}

}  // namespace
}  // namespace varimesh
