// Cells with two faces on one smooth surface are taken out, the mesh conforms, and its new boundary lies on the
// geometry.
#include "core/repair/boundary/boundary_swaps.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "core/curve/curve.h"
#include "core/repair/node_key.h"
#include "tests/core/repair/boundary/conforming.h"
#include "tests/core/support/disc_mesh.h"

namespace varimesh {
namespace {

using testing::DiscMesh;
using testing::solid_cylinder;

struct SwappedMesh {
  HighOrderMesh mesh;
  Association association;
  std::size_t swapped = 0;
  std::vector<RepairStep> steps;
  std::set<std::string> surfaces;
};

std::vector<std::int64_t> all_cells(const HighOrderMesh& mesh) {
  std::vector<std::int64_t> numbers;
  for (const ElementBlock& block : mesh.blocks)
    if (block.shape == Shape::Tetrahedron) numbers.insert(numbers.end(), block.numbers.begin(), block.numbers.end());
  std::ranges::sort(numbers);
  return numbers;
}

SwappedMesh swapped(const HighOrderMesh& mesh, const std::vector<std::int64_t>& wanted,
                    const std::vector<bool>& held = {}, int threads = 1) {
  const Team team(threads);
  SwappedMesh result{mesh, {}, 0, {}, {}};
  team.run([&] {
    auto association = associate(mesh, solid_cylinder(), team);
    ASSERT_TRUE(association) << association.error().sentence;
    result.association = std::move(*association);
    result.swapped =
        swap_boundary_edges(result.mesh, result.association, wanted, held, result.steps, result.surfaces, team);
  });
  return result;
}

using Face = std::array<std::int32_t, 3>;

constexpr std::int64_t kAdded = 1000000;  ///< The number of the cell that is glued on.

Face sorted(Face face) {
  std::ranges::sort(face);
  return face;
}

Eigen::Vector3d x(const HighOrderMesh& mesh, std::int32_t node) {
  return Eigen::Map<const Eigen::Vector3d>(&mesh.coordinates[3 * static_cast<std::size_t>(node)]);
}

/// By triangle of the boundary, whether its vertices run round the vector away from its cell.
std::vector<bool> senses(const HighOrderMesh& mesh) {
  std::map<Face, std::int32_t> fourth;
  for (const ElementBlock& block : mesh.blocks) {
    if (block.shape != Shape::Tetrahedron) continue;
    const std::size_t stride = block.nodes.size() / block.size();
    for (std::size_t e = 0; e < block.size(); ++e)
      for (std::size_t v = 0; v < 4; ++v) {
        const std::int32_t* cell = &block.nodes[e * stride];
        fourth[sorted({cell[(v + 1) % 4], cell[(v + 2) % 4], cell[(v + 3) % 4]})] = cell[v];
      }
  }
  std::vector<bool> result;
  for (const ElementBlock& block : mesh.blocks) {
    if (block.shape != Shape::Triangle) continue;
    const std::size_t stride = block.nodes.size() / block.size();
    for (std::size_t e = 0; e < block.size(); ++e) {
      const std::int32_t* t = &block.nodes[e * stride];
      const Eigen::Vector3d a = x(mesh, t[0]), normal = (x(mesh, t[1]) - a).cross(x(mesh, t[2]) - a);
      result.push_back(normal.dot(x(mesh, fourth.at(sorted({t[0], t[1], t[2]}))) - a) < 0);
    }
  }
  return result;
}

/// By face: the cells that have it, as indices of their first nodes in the block of cells.
std::map<Face, std::vector<std::size_t>> cells_by_face(const ElementBlock& cells) {
  std::map<Face, std::vector<std::size_t>> result;
  const std::size_t stride = cells.nodes.size() / cells.size();
  for (std::size_t at = 0; at < cells.nodes.size(); at += stride)
    for (std::size_t v = 0; v < 4; ++v) {
      const std::int32_t* n = &cells.nodes[at];
      result[sorted({n[(v + 1) % 4], n[(v + 2) % 4], n[(v + 3) % 4]})].push_back(at);
    }
  return result;
}

/// The triangle's nodes with these vertices; new ones are added on the side of the cylinder.
std::vector<std::int32_t> triangle(HighOrderMesh& mesh, std::map<NodeKey, std::int32_t>& known, const Face& vertices) {
  std::vector<std::int32_t> nodes;
  for (const auto& weight : node_weights(Shape::Triangle, mesh.order)) {
    const auto [entry, is_new] = known.try_emplace(node_key({vertices[0], vertices[1], vertices[2], -1}, weight),
                                                   static_cast<std::int32_t>(mesh.node_count()));
    nodes.push_back(entry->second);
    if (!is_new) continue;
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < 3; ++k) place += double(weight[k]) / mesh.order * x(mesh, vertices[k]);
    place.head<2>().normalize();
    mesh.coordinates.insert(mesh.coordinates.end(), place.data(), place.data() + 3);
    mesh.node_numbers.push_back(mesh.node_numbers.back() + 1);
    ++mesh.node_blocks.back().count;
  }
  return nodes;
}

/// By cell, as the index of its first node in the block of cells: how many faces it has on the side.
std::map<std::size_t, int> faces_on_side(const ElementBlock& side, const ElementBlock& cells) {
  const auto by_face = cells_by_face(cells);
  std::map<std::size_t, int> result;
  for (std::size_t at = 0; at < side.nodes.size(); at += side.nodes.size() / side.size())
    ++result[by_face.at(sorted({side.nodes[at], side.nodes[at + 1], side.nodes[at + 2]})).front()];
  return result;
}

/// The mesh with one more cell, on two faces of the side that meet inside it. So the new cell has two faces on the
/// side. The faces belong to cells that have no other face there, or one of them to the cell `behind`.
HighOrderMesh with_cell_on_side(const HighOrderMesh& mesh, std::int64_t cell_number = kAdded,
                                std::optional<std::size_t> behind = std::nullopt) {
  HighOrderMesh result = mesh;
  const auto block_of = [&](Shape shape) {
    return std::ranges::find_if(result.blocks,
                                [&](const ElementBlock& b) { return b.shape == shape && b.entity == 1; });
  };
  ElementBlock& side = *block_of(Shape::Triangle);
  ElementBlock& cells = *block_of(Shape::Tetrahedron);
  const std::size_t stride = side.nodes.size() / side.size(), of_cell = cells.nodes.size() / cells.size();
  const auto by_face = cells_by_face(cells);
  const std::map<std::size_t, int> faces_of = faces_on_side(side, cells);
  std::map<std::array<std::int32_t, 2>, std::vector<std::size_t>> by_edge;
  for (std::size_t at = 0; at < side.nodes.size(); at += stride) {
    const Face face = sorted({side.nodes[at], side.nodes[at + 1], side.nodes[at + 2]});
    for (const auto& [a, b] : {std::pair(0, 1), std::pair(0, 2), std::pair(1, 2)})
      by_edge[{face[std::size_t(a)], face[std::size_t(b)]}].push_back(at);
  }
  for (const auto& [edge, two] : by_edge) {
    if (two.size() != 2) continue;
    std::array<std::int32_t, 2> others{};
    std::map<NodeKey, std::int32_t> known;
    bool is_free = true, is_there = false;
    for (std::size_t k = 0; k < 2; ++k) {
      const Face face{side.nodes[two[k]], side.nodes[two[k] + 1], side.nodes[two[k] + 2]};
      others[k] = *std::ranges::find_if(face, [&](std::int32_t n) { return n != edge[0] && n != edge[1]; });
      is_free = is_free && faces_of.at(by_face.at(sorted(face)).front()) == 1;
      is_there = is_there || by_face.at(sorted(face)).front() == behind;
      const auto weights = node_weights(Shape::Triangle, mesh.order);
      for (std::size_t n = 0; n < stride; ++n)
        known[node_key({face[0], face[1], face[2], -1}, weights[n])] = side.nodes[two[k] + n];
    }
    const double on_circle = (x(mesh, others[0]) - x(mesh, others[1])).norm();
    if (!(behind ? is_there : is_free) ||
        by_edge.contains({std::min(others[0], others[1]), std::max(others[0], others[1])}) || on_circle > 1)
      continue;
    for (std::size_t k = 0; k < 2; ++k) {  // each triangle gets the other new vertex for one end of the old edge
      std::array<std::int32_t, 3> face{side.nodes[two[k]], side.nodes[two[k] + 1], side.nodes[two[k] + 2]};
      std::ranges::replace(face, edge[k], others[1 - k]);
      std::ranges::copy(triangle(result, known, face), side.nodes.begin() + std::ptrdiff_t(two[k]));
    }
    // The cell behind the first triangle, mirrored.
    VertexNodes corners{};
    const std::size_t mirrored = by_face.at(sorted({edge[0], edge[1], others[0]})).front();
    std::copy_n(cells.nodes.begin() + std::ptrdiff_t(mirrored), 4, corners.begin());
    for (std::int32_t& corner : corners)
      if (corner != edge[0] && corner != edge[1] && corner != others[0]) corner = others[1];
    std::swap(corners[0], corners[1]);
    for (const auto& weight : node_weights(Shape::Tetrahedron, mesh.order)) {
      const auto [entry, is_new] =
          known.try_emplace(node_key(corners, weight), static_cast<std::int32_t>(result.node_count()));
      cells.nodes.push_back(entry->second);
      if (!is_new) continue;
      const Eigen::Vector3d middle = x(mesh, edge[0]);
      result.coordinates.insert(result.coordinates.end(), middle.data(), middle.data() + 3);
      result.node_numbers.push_back(result.node_numbers.back() + 1);
      ++result.node_blocks.back().count;
    }
    EXPECT_EQ(cells.nodes.size() % of_cell, 0u);
    cells.numbers.push_back(cell_number);
    return result;
  }
  ADD_FAILURE() << "There are no such faces.";
  return result;
}

/// The vertices of all elements with these nodes, sorted.
std::set<std::vector<std::int32_t>> vertices_of(const HighOrderMesh& mesh, Shape shape) {
  std::set<std::vector<std::int32_t>> result;
  for (const ElementBlock& block : mesh.blocks)
    for (std::size_t e = 0; block.shape == shape && e < block.size(); ++e) {
      const auto first = block.nodes.begin() + std::ptrdiff_t(e * (block.nodes.size() / block.size()));
      std::vector<std::int32_t> vertices(first, first + reference::info(shape).vertices);
      std::ranges::sort(vertices);
      result.insert(vertices);
    }
  return result;
}

class BoundarySwaps : public ::testing::TestWithParam<int> {
 protected:
  const HighOrderMesh plain_ = DiscMesh(3, GetParam()).mesh();
  const HighOrderMesh mesh_ = with_cell_on_side(plain_);
};

TEST_P(BoundarySwaps, TakeOutTheCellWithTwoFacesOnOneSurface) {
  const SwappedMesh made = swapped(mesh_, {kAdded});
  EXPECT_EQ(made.swapped, 1u);
  ASSERT_EQ(made.steps.size(), 1u);
  EXPECT_EQ(made.steps[0].elements, std::vector<std::int64_t>{kAdded});
  EXPECT_EQ(made.surfaces, std::set<std::string>{"1"});
  // The mesh is the one to which the cell was glued.
  EXPECT_EQ(made.mesh.node_count(), plain_.node_count());
  for (const Shape shape : {Shape::Triangle, Shape::Tetrahedron}) {
    EXPECT_EQ(vertices_of(made.mesh, shape), vertices_of(plain_, shape));
    EXPECT_NE(vertices_of(mesh_, shape), vertices_of(plain_, shape));
  }
  EXPECT_EQ(senses(made.mesh), senses(plain_));
}

TEST_P(BoundarySwaps, LeaveACellBesideOneThatHasAFaceThere) {
  // In the corners of the square that was mapped to the disc, cells have two faces on the side, and so would those
  // behind.
  EXPECT_EQ(swapped(plain_, all_cells(plain_)).swapped, 0u);
}

TEST_P(BoundarySwaps, TakeOutOneOfTwoCellsBesideACellThatWouldGetTwoFacesThere) {
  const auto block = [](const HighOrderMesh& mesh, Shape shape) {
    return *std::ranges::find_if(mesh.blocks, [&](const ElementBlock& b) { return b.shape == shape && b.entity == 1; });
  };
  const auto faces = faces_on_side(block(plain_, Shape::Triangle), block(plain_, Shape::Tetrahedron));
  const auto corner = std::ranges::find_if(faces, [](const auto& entry) { return entry.second == 2; });
  ASSERT_NE(corner, faces.end());
  const HighOrderMesh first = with_cell_on_side(plain_, kAdded, corner->first);
  const HighOrderMesh both = with_cell_on_side(first, kAdded + 1, corner->first);
  EXPECT_EQ(swapped(first, {kAdded}).swapped, 0u);  // the cell behind has a face there already
  const SwappedMesh made = swapped(both, {kAdded, kAdded + 1});
  EXPECT_EQ(made.swapped, 1u);
  EXPECT_EQ(swapped(made.mesh, {kAdded, kAdded + 1}).swapped, 0u);
}

TEST_P(BoundarySwaps, LeaveNoBlockWithoutCells) {
  HighOrderMesh divided = mesh_;
  const auto cells = std::ranges::find_if(divided.blocks, [](const ElementBlock& b) {
    return b.shape == Shape::Tetrahedron && !b.numbers.empty() && b.numbers.back() == kAdded;
  });
  ASSERT_NE(cells, divided.blocks.end());
  ElementBlock own = *cells;
  const std::size_t of_cell = cells->nodes.size() / cells->size();
  own.numbers = {kAdded};
  own.nodes.assign(cells->nodes.end() - std::ptrdiff_t(of_cell), cells->nodes.end());
  cells->numbers.pop_back();
  cells->nodes.resize(cells->nodes.size() - of_cell);
  divided.blocks.insert(divided.blocks.begin(), own);
  const SwappedMesh made = swapped(divided, {kAdded});
  EXPECT_EQ(made.swapped, 1u);
  EXPECT_EQ(made.mesh.blocks.size(), plain_.blocks.size());
  EXPECT_EQ(made.association.surface_of_element, swapped(made.mesh, {}).association.surface_of_element);
}

TEST_P(BoundarySwaps, KeepAMeshThatConforms) {
  const SwappedMesh made = swapped(mesh_, all_cells(mesh_));
  testing::expect_conforming(made.mesh);
}

TEST_P(BoundarySwaps, PutTheNewBoundaryOnTheGeometry) {
  const SwappedMesh made = swapped(mesh_, all_cells(mesh_));
  for (const ElementBlock& block : made.mesh.blocks) {
    if (block.shape != Shape::Triangle || block.entity != 1) continue;
    for (const std::int32_t node : block.nodes) EXPECT_NEAR(x(made.mesh, node).head<2>().norm(), 1, 1e-12);
  }
  // The association is that which the mesh itself has.
  const Association own = swapped(made.mesh, {}).association;
  EXPECT_EQ(own.surface_of_element, made.association.surface_of_element);
  for (std::size_t n = 0; n < own.nodes.size(); ++n)
    EXPECT_EQ(own.nodes[n].dimension, made.association.nodes[n].dimension);
  for (std::size_t s = 0; s < own.surfaces.size(); ++s)
    EXPECT_EQ(own.surfaces[s].nodes, made.association.surfaces[s].nodes);
}

TEST_P(BoundarySwaps, ClassifyNodesThatCameToTheBoundary) {
  HighOrderMesh classified = mesh_;
  std::vector<bool> on_surface(mesh_.node_count(), false);
  for (const ElementBlock& block : mesh_.blocks)
    for (std::size_t k = 0; block.shape == Shape::Triangle && k < block.nodes.size(); ++k)
      on_surface[static_cast<std::size_t>(block.nodes[k])] = true;
  classified.node_blocks.clear();
  for (std::size_t n = 0; n < on_surface.size(); ++n)
    classified.node_blocks.push_back({on_surface[n] ? 2 : 3, 1, static_cast<std::int32_t>(n), 1, {}});
  const SwappedMesh made = swapped(classified, all_cells(classified));
  std::vector<bool> is_outer(made.mesh.node_count(), false);
  for (const ElementBlock& block : made.mesh.blocks)
    for (std::size_t k = 0; block.shape == Shape::Triangle && k < block.nodes.size(); ++k)
      is_outer[static_cast<std::size_t>(block.nodes[k])] = true;
  std::int32_t next = 0;
  for (const NodeBlock& block : made.mesh.node_blocks) {
    EXPECT_EQ(block.first, next);
    next += block.count;
    for (std::int32_t n = block.first; n < next; ++n) {
      EXPECT_EQ(block.dimension == 2, is_outer[static_cast<std::size_t>(n)]) << n;
    }
  }
  EXPECT_EQ(next, static_cast<std::int32_t>(made.mesh.node_count()));
}

TEST_P(BoundarySwaps, LeaveEdgesThatAreHeldOrPeriodicOrHaveALine) {
  const std::vector<std::int64_t> all = all_cells(mesh_);
  EXPECT_EQ(swapped(mesh_, all, std::vector<bool>(mesh_.node_count(), true)).swapped, 0u);
  HighOrderMesh periodic = mesh_;
  PeriodicLink link{2, 3, 2, {}, {}};
  for (std::int32_t n = 0; n < static_cast<std::int32_t>(mesh_.node_count()); ++n) link.nodes.emplace_back(n, n);
  periodic.periodic.push_back(link);
  EXPECT_EQ(swapped(periodic, all).swapped, 0u);
  const SwappedMesh made = swapped(mesh_, all);
  ASSERT_GT(made.swapped, 0u);
  HighOrderMesh with_line = mesh_;
  ElementBlock line;
  line.shape = Shape::Line;
  line.order = mesh_.order;
  line.entity = 9;
  line.numbers = {100000};
  const RepairStep& step = made.steps.front();
  for (const std::int64_t number : step.vertices)
    line.nodes.push_back(
        static_cast<std::int32_t>(std::ranges::find(mesh_.node_numbers, number) - mesh_.node_numbers.begin()));
  line.nodes.resize(static_cast<std::size_t>(mesh_.order) + 1, line.nodes.front());  // those between do not matter
  with_line.blocks.push_back(line);
  const SwappedMesh less = swapped(with_line, step.elements);
  EXPECT_EQ(less.swapped, 0u);
  EXPECT_EQ(less.mesh.coordinates, mesh_.coordinates);
}

TEST_P(BoundarySwaps, DoNotDependOnTheNumberOfThreads) {
  const SwappedMesh one = swapped(mesh_, all_cells(mesh_)), three = swapped(mesh_, all_cells(mesh_), {}, 3);
  EXPECT_EQ(one.mesh.coordinates, three.mesh.coordinates);
  EXPECT_EQ(one.mesh.node_numbers, three.mesh.node_numbers);
}

INSTANTIATE_TEST_SUITE_P(Orders, BoundarySwaps, ::testing::Values(2, 3, 4),
                         [](const auto& info) { return "Order" + std::to_string(info.param); });

/// Three tetrahedra in a cylinder. Two faces of the first go round more than half of its side. Without it, its other
/// two faces would go round the axis.
TEST(BoundarySwaps, LeaveCellsThatGoRoundAThinPart) {
  HighOrderMesh linear;
  linear.dimension = 3;
  linear.order = 1;
  const double s = std::sqrt(0.75);
  linear.coordinates = {1, 0, 0.2, 1, 0, 0.8, -0.5, s, 0.5, -0.5, -s, 0.5, 0, 0, 0, 0, 0, 1};
  for (std::int64_t node = 1; node <= 6; ++node) linear.node_numbers.push_back(node);
  linear.blocks.resize(2);
  linear.blocks[0].shape = Shape::Triangle;
  linear.blocks[0].entity = 1;
  linear.blocks[0].nodes = {0, 1, 2, 0, 3, 1};
  linear.blocks[0].numbers = {1, 2};
  linear.blocks[1].shape = Shape::Tetrahedron;
  linear.blocks[1].entity = 1;
  linear.blocks[1].nodes = {0, 1, 3, 2, 0, 2, 3, 4, 1, 3, 2, 5};
  linear.blocks[1].numbers = {3, 4, 5};
  NodeBlock nodes;
  nodes.count = 6;
  linear.node_blocks.push_back(nodes);
  const Team team(1);
  std::size_t done = 0;
  team.run([&] {
    auto association = associate(linear, solid_cylinder(), team);
    ASSERT_TRUE(association) << association.error().sentence;
    auto curved = curve(linear, std::move(*association), 3, team);
    ASSERT_TRUE(curved) << curved.error().sentence;
    std::vector<RepairStep> steps;
    std::set<std::string> surfaces;
    const std::vector<std::int64_t> wanted{3};
    done = swap_boundary_edges(curved->mesh, curved->association, wanted, {}, steps, surfaces, team);
  });
  EXPECT_EQ(done, 0u);
}

}  // namespace
}  // namespace varimesh
