#include "core/formats/vtu/boundary.h"

#include <algorithm>
#include <map>
#include <span>
#include <string>
#include <unordered_map>

#include "core/formats/vtu/write.h"
#include "core/mesh/changes/serendipity_elements.h"
#include "core/mesh/changes/shared_nodes.h"
#include "core/reference/nodes.h"

namespace varimesh::formats {

namespace {

using detail::Vertices;

/// A side of a cell.
struct Side {
  std::int64_t cell = -1;  ///< −1: no cell has it.
  const ElementBlock* block = nullptr;
  const std::int32_t* nodes = nullptr;  ///< Of the cell.
  int facet = 0;
};

Vertices sorted(Vertices vertices) {
  std::sort(vertices.begin(), vertices.end());
  return vertices;
}

/// Calls body(block, nodes of the element) for each element of this dimension.
template <class Body>
void for_elements(const HighOrderMesh& mesh, int dimension, const Body& body) {
  for (const ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == dimension)
      for (std::size_t e = 0; e < block.size(); ++e) body(block, block.nodes.data() + e * nodes_per_element(block));
}

/// The sides of cells where the elements of the boundary are.
class Sides {
 public:
  explicit Sides(const HighOrderMesh& mesh) {
    std::vector<bool> on_boundary(mesh.node_count(), false);
    for_elements(mesh, mesh.dimension - 1, [&](const ElementBlock& block, const std::int32_t* nodes) {
      for (int i = 0; i < reference::info(block.shape).vertices; ++i) on_boundary[std::size_t(nodes[i])] = true;
      sides_.emplace(sorted(vertices_of(block, nodes)), Side{});
    });
    std::int64_t cell = 0;
    for_elements(mesh, mesh.dimension, [&](const ElementBlock& block, const std::int32_t* nodes) {
      const auto& facets = reference::info(block.shape).facets;
      for (std::size_t f = 0; f < facets.size(); ++f) {
        const Vertices vertices = detail::face_vertices(facets[f], nodes);
        if (std::ranges::any_of(vertices, [&](auto node) { return node >= 0 && !on_boundary[std::size_t(node)]; }))
          continue;
        const auto found = sides_.find(sorted(vertices));
        if (found != sides_.end() && found->second.cell < 0) found->second = {cell, &block, nodes, int(f)};
      }
      ++cell;
    });
  }

  const Side& at(const ElementBlock& block, const std::int32_t* nodes) const {
    return sides_.at(sorted(vertices_of(block, nodes)));
  }

 private:
  static Vertices vertices_of(const ElementBlock& block, const std::int32_t* nodes) {
    Vertices vertices{-1, -1, -1, -1};
    std::copy_n(nodes, reference::info(block.shape).vertices, vertices.begin());
    return vertices;
  }
  std::unordered_map<Vertices, Side, detail::HashVertices> sides_;
};

/// The nodes of an edge of a plane cell as a line has them that begins at the vertex `first`.
std::vector<std::int32_t> line_on(const Side& side, std::int32_t first) {
  std::vector<std::int32_t> nodes;
  for (const int local : reference::facet_nodes(side.block->shape, side.block->order, side.facet))
    nodes.push_back(side.nodes[local]);
  if (nodes[0] != first) {
    std::swap(nodes[0], nodes[1]);
    std::reverse(nodes.begin() + 2, nodes.end());
  }
  return nodes;
}

}  // namespace

std::vector<std::int64_t> cells_of_boundary(const HighOrderMesh& mesh) {
  const Sides sides(mesh);
  std::vector<std::int64_t> cells;
  for_elements(mesh, mesh.dimension - 1, [&](const ElementBlock& block, const std::int32_t* nodes) {
    cells.insert(cells.end(), pieces_of(mesh, block), sides.at(block, nodes).cell);
  });
  return cells;
}

std::size_t pieces_of(const HighOrderMesh& mesh, const ElementBlock& block) {
  return mesh.dimension == 2 && block.shape == Shape::Line ? static_cast<std::size_t>(block.order) : 1;
}

VtkCell vtk_pieces(int order) {
  VtkCell cell = vtk_cell(Shape::Line, 1);
  cell.nodes.clear();
  // A line has its ends first, and then the nodes between them.
  for (int piece = 0; piece < order; ++piece)
    for (const int place : {piece, piece + 1}) cell.nodes.push_back(place == 0 ? 0 : place == order ? 1 : place + 1);
  return cell;
}

namespace {

/// Adds a line with these nodes, and with the groups of the block `like`.
void add_line(std::vector<ElementBlock>& blocks, const ElementBlock& like, std::int64_t number,
              const std::vector<std::int32_t>& nodes, FileAllowance& allowance) {
  const int order = int(nodes.size()) - 1;
  const auto fits = [&](const ElementBlock& last) {
    return last.shape == Shape::Line && last.order == order && last.entity == like.entity &&
           last.physical == like.physical;
  };
  if (blocks.empty() || !fits(blocks.back())) {
    allowance.take(1, sizeof(ElementBlock));
    blocks.push_back({Shape::Line, order, like.entity, like.physical, {}, {}, {}, {}});
  }
  ElementBlock& block = blocks.back();
  allowance.make_room(block.numbers, 1);
  allowance.make_room(block.nodes, nodes.size());
  block.numbers.push_back(number);
  block.nodes.insert(block.nodes.end(), nodes.begin(), nodes.end());
}

/// Joins the pieces of lines: each that has the number kNextPiece goes on where the one before ends.
void join_pieces(HighOrderMesh& mesh, FileAllowance& allowance) {
  std::int64_t largest = 0;
  bool has_pieces = false;
  for (const ElementBlock& block : mesh.blocks)
    for (const std::int64_t number : block.numbers) {
      largest = std::max(largest, number);
      has_pieces = has_pieces || number == kNextPiece;
    }
  if (!has_pieces) return;
  std::vector<ElementBlock> blocks;
  for (ElementBlock& block : mesh.blocks) {
    if (block.shape != Shape::Line || block.order != 1) {
      blocks.push_back(std::move(block));
      continue;
    }
    for (std::size_t e = 0; e < block.size();) {
      std::vector<std::int32_t> nodes = {block.nodes[2 * e], block.nodes[2 * e + 1]};
      const std::int64_t number = block.numbers[e] == kNextPiece ? ++largest : block.numbers[e];
      for (++e; e < block.size() && block.numbers[e] == kNextPiece && block.nodes[2 * e] == nodes[1] &&
                std::ssize(nodes) <= kMaxOrder;
           ++e) {
        nodes.push_back(nodes[1]);
        nodes[1] = block.nodes[2 * e + 1];
      }
      add_line(blocks, block, number, nodes, allowance);
    }
  }
  mesh.blocks = std::move(blocks);
}

}  // namespace

void curve_lines(HighOrderMesh& mesh, FileAllowance& allowance) {
  join_pieces(mesh, allowance);
  const auto is_straight = [](const ElementBlock& block) { return block.shape == Shape::Line && block.order == 1; };
  const auto is_curved = [](const ElementBlock& block) {
    return reference::info(block.shape).dimension == 2 && block.order > 1;
  };
  if (mesh.dimension != 2 || std::ranges::none_of(mesh.blocks, is_straight) ||
      std::ranges::none_of(mesh.blocks, is_curved))
    return;
  for (const ElementBlock& block : mesh.blocks)
    if (is_straight(block)) allowance.take(block.size(), kTreeNode + sizeof(Side));
  const Sides sides(mesh);
  std::vector<ElementBlock> blocks;
  for (ElementBlock& block : mesh.blocks) {
    if (!is_straight(block)) {
      blocks.push_back(std::move(block));  // its nodes stay where they are, so `sides` may refer to them
      continue;
    }
    for (std::size_t e = 0; e < block.size(); ++e) {
      const std::int32_t* ends = block.nodes.data() + 2 * e;
      const Side& side = sides.at(block, ends);
      const std::vector<std::int32_t> nodes = side.cell >= 0 ? line_on(side, ends[0]) : std::vector{ends[0], ends[1]};
      add_line(blocks, block, block.numbers[e], nodes, allowance);
    }
  }
  mesh.blocks = std::move(blocks);
}

}  // namespace varimesh::formats
