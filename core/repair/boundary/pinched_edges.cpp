#include "core/repair/boundary/pinched_edges.h"

#include <algorithm>
#include <optional>
#include <set>
#include <utility>

#include "core/base/index.h"

namespace varimesh {
namespace {

/// The elements of the surfaces at one edge.
struct AtEdge {
  int surface, entity;
  std::int32_t apex;
};

/// The vertices of a cell that are not ends of the edge.
std::vector<std::int32_t> others(std::span<const std::int32_t> vertices, const SplitPlace& place) {
  std::vector<std::int32_t> result;
  for (const std::int32_t vertex : vertices)
    if (vertex != place[0] && vertex != place[1]) result.push_back(vertex);
  return result;
}

/// The vertices from an apex through cells around the edge to another apex, both included.
std::vector<std::int32_t> walk(std::int32_t from, std::vector<std::array<std::int32_t, 2>> cells) {
  std::vector<std::int32_t> result{from};
  const auto next = [&] {
    return std::ranges::find_if(cells,
                                [&](const auto& cell) { return cell[0] == result.back() || cell[1] == result.back(); });
  };
  for (auto cell = next(); cell != cells.end(); cell = next()) {
    result.push_back((*cell)[0] == result.back() ? (*cell)[1] : (*cell)[0]);
    cells.erase(cell);
  }
  return result;
}

/// The two sides, if the cells around the edge lie in two groups, each between two elements of one surface.
std::optional<PinchedEdge> sides_of(const std::vector<AtEdge>& elements, const SplitPlace& place, const Cells& cells,
                                    const SplitRules& rules) {
  std::vector<std::array<std::int32_t, 2>> around;
  for (const std::int32_t cell : rules.cells_around(place)) {
    if (cells.shape(at(cell)) != Shape::Tetrahedron) return std::nullopt;
    const std::vector<std::int32_t> rest = others(cells.nodes(at(cell)).first(4), place);
    around.push_back({rest[0], rest[1]});
  }
  PinchedEdge edge;
  std::size_t found = 0, walked = 0;
  std::set<std::int32_t> seen;
  for (const AtEdge& element : elements) {
    if (seen.contains(element.apex)) continue;
    if (found == 2) return std::nullopt;
    std::vector<std::int32_t> beside = walk(element.apex, around);
    const auto other = std::ranges::find(elements, beside.back(), &AtEdge::apex);
    if (beside.size() < 2 || other == elements.end() || other->surface != element.surface ||
        other->entity != element.entity)
      return std::nullopt;
    seen.insert({element.apex, other->apex});
    walked += beside.size() - 1;
    edge.sides[found++] = {element.surface, element.entity, {element.apex, other->apex}, std::move(beside)};
  }
  const bool is_whole = found == 2 && walked == around.size() && edge.sides[0].surface != edge.sides[1].surface;
  return is_whole ? std::optional(std::move(edge)) : std::nullopt;
}

bool is_classified(const HighOrderMesh& mesh) {
  return std::ranges::none_of(mesh.node_blocks, [](const NodeBlock& block) { return block.dimension < 0; });
}

/// The entity on which a node is classified, as its tag; nothing if it is not on a surface.
std::optional<int> entity_of(const HighOrderMesh& mesh, std::int32_t node) {
  for (const NodeBlock& block : mesh.node_blocks)
    if (node >= block.first && node < block.first + block.count && block.dimension == 2) return block.entity;
  return std::nullopt;
}

/// The nodes between both ends of the place, and nowhere else, of an element on this side; their places in the element.
std::vector<std::size_t> nodes_between(const VertexNodes& vertices, const NodeWeights& weights, const SplitPlace& place,
                                       const std::vector<std::int32_t>& beside) {
  std::vector<std::size_t> result;
  std::array<bool, 4> is_end{};
  for (std::size_t v = 0; v < 4; ++v) {
    is_end[v] = vertices[v] == place[0] || vertices[v] == place[1];
    if (vertices[v] >= 0 && !is_end[v] && std::ranges::find(beside, vertices[v]) == beside.end()) return {};
  }
  if (std::ranges::count(is_end, true) != 2) return {};
  for (std::size_t n = 0; n < weights.size(); ++n) {
    bool is_between = true;
    for (std::size_t v = 0; v < 4; ++v) is_between = is_between && (weights[n][v] > 0) == is_end[v];
    if (is_between) result.push_back(n);
  }
  return result;
}

}  // namespace

std::map<SplitPlace, PinchedEdge> pinched_edges(const HighOrderMesh& mesh, const Association& association,
                                                const detail::MeshParts& parts, const Cells& cells,
                                                const SplitRules& rules) {
  std::map<SplitPlace, std::vector<AtEdge>> found;
  std::map<SplitPlace, std::int32_t> inner;  // a node between the ends
  for (const detail::MeshEdge& edge : parts.edges)
    if (mesh.dimension == 3 && edge.elements == 4 && edge.surfaces.size() == 2 && edge.surfaces.front() >= 0 &&
        !edge.inner.empty()) {
      found[edge_place(edge.ends[0], edge.ends[1])];
      inner[edge_place(edge.ends[0], edge.ends[1])] = edge.inner.front();
    }
  if (found.empty()) return {};
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const ElementBlock& block = mesh.blocks[b];
    const auto stride = at(reference::node_count(block.shape, block.order));
    for (std::size_t e = 0; e < block.size(); ++e) {
      const std::int32_t* nodes = &block.nodes[e * stride];
      if (block.shape == Shape::Line) found.erase(edge_place(nodes[0], nodes[1]));
      if (block.shape != Shape::Triangle) continue;
      for (std::size_t v = 0; v < 3; ++v)
        if (const auto at_edge = found.find(edge_place(nodes[(v + 1) % 3], nodes[(v + 2) % 3])); at_edge != found.end())
          at_edge->second.push_back({association.surface_of_element[b][e], block.entity, nodes[v]});
    }
  }
  std::map<SplitPlace, PinchedEdge> result;
  for (const auto& [place, elements] : found) {
    std::optional<PinchedEdge> edge = elements.size() == 4 ? sides_of(elements, place, cells, rules) : std::nullopt;
    if (!edge) continue;
    // The first side keeps the nodes, so it is that on which they are classified.
    const std::optional<int> entity = entity_of(mesh, inner.at(place));
    if (entity == edge->sides[1].entity) std::swap(edge->sides[0], edge->sides[1]);
    if (!is_classified(mesh) || entity == edge->sides[0].entity) result.emplace(place, std::move(*edge));
  }
  return result;
}

void part_nodes(HighOrderMesh& mesh, std::span<const SplitPlace> places,
                const std::map<SplitPlace, PinchedEdge>& pinched) {
  const bool classified = is_classified(mesh);
  std::vector<NodeWeights> weights;  // by block; empty for elements that no side has
  std::map<SplitPlace, std::vector<std::array<std::size_t, 2>>> around;  // by block and index in the block
  for (const SplitPlace& place : places)
    if (pinched.contains(place)) around.try_emplace(place);
  if (around.empty()) return;
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const ElementBlock& block = mesh.blocks[b];
    const bool is_simplex = block.shape == Shape::Triangle || block.shape == Shape::Tetrahedron;
    weights.push_back(is_simplex ? node_weights(block.shape, block.order) : NodeWeights());
    for (std::size_t e = 0; is_simplex && e < block.size(); ++e) {
      const VertexNodes vertices = vertex_nodes(block.shape, &block.nodes[e * weights[b].size()]);
      for (std::size_t v = 0; v < 4; ++v)
        for (std::size_t w = 0; w < v && vertices[v] >= 0; ++w)
          if (const auto found = around.find(edge_place(vertices[v], vertices[w])); found != around.end())
            found->second.push_back({b, e});
    }
  }
  std::int64_t last = *std::ranges::max_element(mesh.node_numbers);
  for (const SplitPlace& place : places) {
    const auto elements = around.find(place);
    if (elements == around.end()) continue;
    const PinchedEdge::Side& side = pinched.at(place).sides[1];
    const auto first = static_cast<std::int32_t>(mesh.node_count());
    std::map<std::int32_t, std::int32_t> copy_of;
    for (const auto& [b, e] : elements->second) {
      std::int32_t* nodes = &mesh.blocks[b].nodes[e * weights[b].size()];
      for (const std::size_t n :
           nodes_between(vertex_nodes(mesh.blocks[b].shape, nodes), weights[b], place, side.beside)) {
        const auto [copy, is_new] = copy_of.try_emplace(nodes[n], first + static_cast<std::int32_t>(copy_of.size()));
        if (is_new) {
          for (std::size_t c = 0; c < 3; ++c) mesh.coordinates.push_back(mesh.coordinates[3 * at(nodes[n]) + c]);
          mesh.node_numbers.push_back(++last);
        }
        nodes[n] = copy->second;
      }
    }
    const auto count = static_cast<std::int32_t>(copy_of.size());
    mesh.node_blocks.push_back(classified ? NodeBlock{2, side.entity, first, count, {}}
                                          : NodeBlock{-1, 0, first, count, {}});
  }
}

}  // namespace varimesh
