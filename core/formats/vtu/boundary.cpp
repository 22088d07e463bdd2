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
    cells.push_back(sides.at(block, nodes).cell);
  });
  return cells;
}

bool is_written_straight(const HighOrderMesh& mesh, const ElementBlock& block) {
  return mesh.dimension == 2 && block.shape == Shape::Line && block.order > 1;
}

std::vector<std::int32_t> loose_lines(const HighOrderMesh& mesh) {
  std::vector<std::int32_t> list;
  if (std::ranges::none_of(mesh.blocks, [&](const auto& block) { return is_written_straight(mesh, block); }))
    return list;
  const Sides sides(mesh);
  std::int32_t place = 0;
  for_elements(mesh, 1, [&](const ElementBlock& block, const std::int32_t* nodes) {
    const std::span own(nodes, nodes_per_element(block));
    const Side& side = sides.at(block, nodes);
    const bool on_edge =
        side.cell >= 0 && side.block->order == block.order && std::ranges::equal(line_on(side, nodes[0]), own);
    if (block.order > 1 && !on_edge) {
      list.insert(list.end(), {place, block.order});
      list.insert(list.end(), own.begin(), own.end());
    }
    ++place;
  });
  return list;
}

namespace {

/// The lines of a list, by their places.
class ListedLines {
 public:
  ListedLines(const HighOrderMesh& mesh, const std::vector<std::int32_t>& list, FileAllowance& allowance) {
    for (std::size_t at = 0; at < list.size();) {
      const std::int32_t order = at + 1 < list.size() ? list[at + 1] : 0;
      const std::size_t count = order >= 1 && order <= kMaxOrder ? std::size_t(order) + 1 : list.size();
      if (at + 2 + count > list.size()) fail("ends within a line, or has an order that no line has");
      const std::span nodes(list.data() + at + 2, count);
      const auto is_there = [&](std::int32_t node) { return node >= 0 && std::size_t(node) < mesh.node_count(); };
      if (std::ranges::all_of(nodes, is_there)) {
        allowance.take(1, kTreeNode);
        lines_[list[at]] = nodes;
      }
      at += 2 + count;
    }
  }

  /// The nodes of the line at this place if it has these ends; otherwise nothing.
  std::span<const std::int32_t> at(std::int32_t place, const std::int32_t* ends) const {
    const auto found = lines_.find(place);
    if (found == lines_.end() || found->second[0] != ends[0] || found->second[1] != ends[1]) return {};
    return found->second;
  }

 private:
  [[noreturn]] static void fail(const std::string& what) {
    throw ReadFailure{"The mesh file cannot be read: its list of curved lines, " + std::string(kVtkLines) + ", " +
                      what + ". Write the file again, or remove the list."};
  }

  std::map<std::int32_t, std::span<const std::int32_t>> lines_;
};

}  // namespace

void curve_lines(HighOrderMesh& mesh, const std::vector<std::int32_t>& listed, FileAllowance& allowance) {
  const auto is_straight = [](const ElementBlock& block) { return block.shape == Shape::Line && block.order == 1; };
  const auto is_curved = [](const ElementBlock& block) {
    return reference::info(block.shape).dimension == 2 && block.order > 1;
  };
  if (mesh.dimension != 2 || std::ranges::none_of(mesh.blocks, is_straight) ||
      (listed.empty() && std::ranges::none_of(mesh.blocks, is_curved)))
    return;
  const ListedLines list(mesh, listed, allowance);
  for (const ElementBlock& block : mesh.blocks)
    if (is_straight(block)) allowance.take(block.size(), kTreeNode + sizeof(Side));
  const Sides sides(mesh);
  std::vector<ElementBlock> blocks;
  std::int32_t place = 0;
  for (ElementBlock& block : mesh.blocks) {
    if (!is_straight(block)) {
      if (block.shape == Shape::Line) place += std::int32_t(block.size());
      blocks.push_back(std::move(block));  // its nodes stay where they are, so `sides` may refer to them
      continue;
    }
    for (std::size_t e = 0; e < block.size(); ++e) {
      const std::int32_t* ends = block.nodes.data() + 2 * e;
      const Side& side = sides.at(block, ends);
      const std::span<const std::int32_t> own = list.at(place++, ends);
      const std::vector<std::int32_t> nodes = !own.empty()     ? std::vector(own.begin(), own.end())
                                              : side.cell >= 0 ? line_on(side, ends[0])
                                                               : std::vector{ends[0], ends[1]};
      const int order = int(nodes.size()) - 1;
      if (e == 0 || blocks.back().order != order) {
        allowance.take(1, sizeof(ElementBlock));
        blocks.push_back({block.shape, order, block.entity, block.physical, {}, {}, {}, {}});
      }
      allowance.make_room(blocks.back().numbers, 1);
      allowance.make_room(blocks.back().nodes, nodes.size());
      blocks.back().numbers.push_back(block.numbers[e]);
      blocks.back().nodes.insert(blocks.back().nodes.end(), nodes.begin(), nodes.end());
    }
  }
  mesh.blocks = std::move(blocks);
}

}  // namespace varimesh::formats
