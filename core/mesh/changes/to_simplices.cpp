#include "core/mesh/changes/to_simplices.h"

#include <algorithm>
#include <array>
#include <map>
#include <numeric>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "core/base/index.h"
#include "core/mesh/check.h"
#include "core/reference/nodes.h"

namespace varimesh {
namespace {

/// Local vertices of a simplex; a triangle has −1 last.
using Corners = std::array<int, 4>;
/// By local vertex: its place in the order of the element's vertices.
using Ranks = std::array<int, 8>;

int lowest_of(std::span<const std::int8_t> vertices, const Ranks& rank) {
  return static_cast<int>(std::ranges::min_element(vertices, {}, [&](int v) { return rank[at(v)]; }) -
                          vertices.begin());
}

/// The triangles of a face, each counter-clockwise if the face is.
std::vector<Corners> triangles_of(const reference::Facet& face, const Ranks& rank) {
  const auto& v = face.vertices;
  if (face.shape == Shape::Triangle) return {{v[0], v[1], v[2], -1}};
  const int low = lowest_of(v, rank);
  const auto next = [&](int step) { return static_cast<int>(v[at((low + step) % 4)]); };
  return {{next(0), next(1), next(2), -1}, {next(0), next(2), next(3), -1}};
}

std::vector<Corners> simplices_of(Shape shape, const Ranks& rank) {
  const reference::ShapeInfo& info = reference::info(shape);
  if (info.dimension == 2) return triangles_of(info.faces[0], rank);
  const auto lowest = static_cast<int>(std::min_element(rank.begin(), rank.begin() + info.vertices) - rank.begin());
  std::vector<Corners> simplices;
  for (const reference::Facet& facet : info.facets) {
    if (std::ranges::find(facet.vertices, lowest) != facet.vertices.end()) continue;
    // The facet is counter-clockwise seen from outside, so it is turned over to be so seen from the lowest vertex.
    for (const Corners& t : triangles_of(facet, rank)) simplices.push_back({t[0], t[2], t[1], lowest});
  }
  return simplices;
}

/// Local nodes of the simplices of a cell, simplex after simplex.
std::vector<int> nodes_of_simplices(Shape shape, int order, const Ranks& rank) {
  const auto& lattice = reference::lattice(shape, order);
  std::map<std::array<int, 3>, int> node_at;
  for (std::size_t node = 0; node < lattice.size(); ++node)
    node_at[{lattice[node][0], lattice[node][1], lattice[node][2]}] = static_cast<int>(node);
  const Shape simplex = reference::info(shape).dimension == 2 ? Shape::Triangle : Shape::Tetrahedron;
  std::vector<int> nodes;
  for (const Corners& corners : simplices_of(shape, rank))
    for (const auto& place : reference::lattice(simplex, order)) {
      const std::array<int, 4> weight{order - place[0] - place[1] - place[2], place[0], place[1], place[2]};
      std::array<int, 3> sum{};
      for (std::size_t v = 0; v < 4; ++v)
        for (std::size_t c = 0; c < 3; ++c)
          if (corners[v] >= 0) sum[c] += weight[v] * lattice[at(corners[v])][c];
      for (int& coordinate : sum) coordinate /= order;
      nodes.push_back(node_at.at(sum));
    }
  return nodes;
}

class Cutter {
 public:
  Cutter(const HighOrderMesh& mesh, std::vector<std::int32_t>* parents)
      : mesh_(mesh), parents_(parents), rank_(mesh.node_count()) {
    std::iota(rank_.begin(), rank_.end(), 0);
    for (const PeriodicLink& link : mesh.periodic)
      for (const auto& [node, master] : link.nodes) rank_[at(node)] = std::min(rank_[at(node)], rank_[at(master)]);
    for (const ElementBlock& block : mesh.blocks)
      for (const auto* numbers : {&block.numbers, &block.repeat_numbers})
        for (const std::int64_t number : *numbers) last_ = std::max(last_, number);
  }

  HighOrderMesh cut() {
    HighOrderMesh result = mesh_;
    for (ElementBlock& block : result.blocks) {
      const reference::ShapeInfo& info = reference::info(block.shape);
      const std::size_t had = block.size();
      if (info.dimension >= 2 && !info.affine) cut(block);
      if (info.dimension == mesh_.dimension) note_parents(had, block.size());
    }
    std::erase_if(result.foreign, [](const ForeignSection& section) {
      return section.name == "ElementData" || section.name == "ElementNodeData";
    });
    return result;
  }

 private:
  /// All elements of a block have the same number of parts.
  void note_parents(std::size_t had, std::size_t has) {
    if (parents_ == nullptr || had == 0) return;
    for (std::size_t e = 0; e < had; ++e) parents_->insert(parents_->end(), has / had, cell_++);
  }

  void cut(ElementBlock& block) {
    const ElementBlock old = block;
    const bool is_flat = reference::info(old.shape).dimension == 2;
    const std::size_t repeats = old.size() == 0 ? 0 : old.repeat_numbers.size() / old.size();
    const std::size_t stride = old.size() == 0 ? 0 : old.nodes.size() / old.size();
    block.shape = is_flat ? Shape::Triangle : Shape::Tetrahedron;
    block.nodes.clear();
    block.numbers.clear();
    block.repeat_numbers.clear();
    for (std::size_t e = 0; e < old.size(); ++e) {
      const std::int32_t* nodes = old.nodes.data() + e * stride;
      const std::vector<int>& locals = pattern(old.shape, old.order, nodes);
      for (const int local : locals) block.nodes.push_back(nodes[local]);
      const std::size_t parts = locals.size() / at(reference::node_count(block.shape, old.order));
      for (std::size_t part = 0; part < parts; ++part) {
        block.numbers.push_back(part == 0 ? old.numbers[e] : ++last_);
        for (std::size_t r = 0; r < repeats; ++r)
          block.repeat_numbers.push_back(part == 0 ? old.repeat_numbers[e * repeats + r] : ++last_);
      }
    }
  }

  const std::vector<int>& pattern(Shape shape, int order, const std::int32_t* nodes) {
    const int count = reference::info(shape).vertices;
    std::array<int, 8> by_rank{};
    std::iota(by_rank.begin(), by_rank.begin() + count, 0);
    std::sort(by_rank.begin(), by_rank.begin() + count, [&](int a, int b) {
      return std::pair(rank_[at(nodes[a])], nodes[a]) < std::pair(rank_[at(nodes[b])], nodes[b]);
    });
    Ranks rank{};
    for (int r = 0; r < count; ++r) rank[at(by_rank[at(r)])] = r;
    const auto [found, is_new] = patterns_.try_emplace({shape, order, rank});
    if (is_new) found->second = nodes_of_simplices(shape, order, rank);
    return found->second;
  }

  const HighOrderMesh& mesh_;
  std::vector<std::int32_t>* parents_;
  std::int32_t cell_ = 0;
  std::vector<std::int32_t> rank_;  ///< By node: its index, or that of its periodic master if that is lower.
  std::int64_t last_ = 0;           ///< The highest number of an element.
  std::map<std::tuple<Shape, int, Ranks>, std::vector<int>> patterns_;
};

}  // namespace

Expected<HighOrderMesh> to_simplices(const HighOrderMesh& mesh, std::vector<std::int32_t>* parents) {
  if (const auto checked = check_blocks(mesh); !checked) return tl::unexpected(checked.error());
  std::int64_t cells = 0;
  for (const ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == mesh.dimension) cells += 6 * std::int64_t(block.size());
  if (const auto checked = check_counts(std::int64_t(mesh.node_count()), cells); !checked)
    return tl::unexpected(checked.error());
  return Cutter(mesh, parents).cut();
}

}  // namespace varimesh
