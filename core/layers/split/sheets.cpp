#include "core/layers/split/sheets.h"

#include <algorithm>
#include <numeric>
#include <unordered_map>

#include "core/base/index.h"
#include "core/mesh/connectivity.h"

namespace varimesh::detail {

Sheets::Sheets(const HighOrderMesh& mesh, const Topology& topology)
    : root_(at(topology.edge_count())),
      turned_(root_.size(), false),
      twisted_(root_.size(), false),
      opposite_(root_.size()) {
  std::iota(root_.begin(), root_.end(), 0);
  // Two edges with their ends in the same order: from a to b, and from c to d.
  const auto link = [&](std::int32_t a, std::int32_t b, std::int32_t c, std::int32_t d) {
    const std::int32_t one = topology.edge(a, b), other = topology.edge(c, d);
    if (one < 0 || other < 0 || one == other) return;
    const bool same = (a < b) == (c < d);
    const std::pair entry{other, same};
    if (std::ranges::find(opposite_[at(one)], entry) != opposite_[at(one)].end()) return;
    opposite_[at(one)].push_back(entry);
    opposite_[at(other)].emplace_back(one, same);
    join(one, other, same);
  };
  const Cells cells(mesh, mesh.dimension);
  for (std::size_t cell = 0; cell < cells.count(); ++cell) {
    const auto nodes = cells.nodes(cell);
    for (const reference::Facet& face : reference::info(cells.shape(cell)).faces) {
      if (face.shape != Shape::Quadrilateral) continue;
      const auto v = [&](std::size_t corner) { return nodes[at(face.vertices[corner])]; };
      link(v(0), v(1), v(3), v(2));
      link(v(1), v(2), v(0), v(3));
    }
  }
  for (const PeriodicLink& periodic : mesh.periodic) {
    std::unordered_map<std::int32_t, std::int32_t> partner(periodic.nodes.begin(), periodic.nodes.end());
    for (const ElementBlock& block : mesh.blocks) {
      const reference::ShapeInfo& info = reference::info(block.shape);
      if (info.dimension != periodic.dimension || block.entity != periodic.entity || block.size() == 0) continue;
      const std::size_t stride = block.nodes.size() / block.size();
      for (std::size_t e = 0; e < block.size(); ++e)
        for (const auto& edge : info.edges) {
          const std::int32_t a = block.nodes[e * stride + at(edge[0])], b = block.nodes[e * stride + at(edge[1])];
          const auto c = partner.find(a), d = partner.find(b);
          if (c != partner.end() && d != partner.end()) link(a, b, c->second, d->second);
        }
    }
  }
  for (std::int32_t edge = 0; edge < std::int32_t(root_.size()); ++edge) find(edge);
}

std::pair<std::int32_t, bool> Sheets::find(std::int32_t edge) {
  std::int32_t root = edge;
  bool turned = false;
  while (root_[at(root)] != root) {
    turned = turned != turned_[at(root)];
    root = root_[at(root)];
  }
  // Each edge on the way is hung at the root.
  bool rest = turned;
  for (std::int32_t on_way = edge; on_way != root;) {
    const std::int32_t next = root_[at(on_way)];
    const bool to_next = turned_[at(on_way)];
    root_[at(on_way)] = root;
    turned_[at(on_way)] = rest;
    rest = rest != to_next;
    on_way = next;
  }
  return {root, turned};
}

void Sheets::join(std::int32_t a, std::int32_t b, bool same) {
  auto [one, one_turned] = find(a);
  auto [other, other_turned] = find(b);
  const bool turn = (one_turned != other_turned) == same;
  if (one == other) {
    if (turn) twisted_[at(one)] = true;
    return;
  }
  if (other < one) std::swap(one, other);
  root_[at(other)] = one;
  turned_[at(other)] = turn;
  if (twisted_[at(other)]) twisted_[at(one)] = true;
}

}  // namespace varimesh::detail
