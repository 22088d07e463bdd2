// New nodes are made cell by cell: those on edges, then those on faces, then inner nodes.
#include "core/mesh/changes/change_order.h"

#include <algorithm>
#include <array>
#include <map>
#include <unordered_map>

#include "core/mesh/changes/shared_nodes.h"
#include "core/mesh/check.h"
#include "core/mesh/mesh_counts.h"
#include "core/reference/basis.h"
#include "core/reference/nodes.h"

namespace varimesh {
namespace {

using detail::face_vertices;
using detail::PlacedNode;
using detail::SharedNodes;
using detail::Vertices;
using reference::NodeSet;

constexpr std::int32_t kNone = -1;

// === Nodes ===============================================================================================

// The nodes of one shape and order, and their values.
struct Pattern : detail::CellNodes {
  Eigen::MatrixXd values;  // interpolation matrix: new nodes × old nodes
};

Pattern make_pattern(Shape shape, int from, int to, int ambient) {
  const reference::Points& at = reference::nodes(shape, to, NodeSet::Equispaced, ambient);
  return {detail::cell_nodes(shape, to, ambient),
          reference::basis_values(shape, from, NodeSet::Equispaced, ambient, at)};
}

// === The whole mesh ======================================================================================

// The elements of a block after the change. A node is an old vertex (its index, ≥ 0) or a new node (−1 − its number).
using Provisional = std::vector<std::int32_t>;

// Converts the number of a new node to its code in Provisional, and back.
constexpr std::int32_t coded(std::int32_t fresh) { return -1 - fresh; }

class OrderChange {
 public:
  OrderChange(const HighOrderMesh& mesh, int order) : mesh_(mesh), order_(order), shared_(order) {}

  HighOrderMesh apply() {
    elements_.resize(mesh_.blocks.size());
    // From the highest dimension down: the cells define the positions, and each node is finally classified on the
    // lowest entity that has it.
    for (int dimension = mesh_.dimension; dimension >= 0; --dimension)
      for (std::size_t b = 0; b < mesh_.blocks.size(); ++b)
        if (reference::info(mesh_.blocks[b].shape).dimension == dimension) make_block(b);
    HighOrderMesh result;
    result.dimension = mesh_.dimension;
    result.order = order_;
    result.entities = mesh_.entities;
    result.physical_groups = mesh_.physical_groups;
    place_nodes(result);
    place_elements(result);
    for (const PeriodicLink& link : mesh_.periodic) place_link(result, link);
    for (const ForeignSection& section : mesh_.foreign)
      if (section.name != "NodeData" && section.name != "ElementNodeData") result.foreign.push_back(section);
    return result;
  }

 private:
  const Pattern& pattern(const ElementBlock& block) {
    const auto [at, is_new] = patterns_.try_emplace({block.shape, block.order});
    if (is_new) at->second = make_pattern(block.shape, block.order, order_, mesh_.dimension);
    return at->second;
  }

  void make_block(std::size_t index) {
    const ElementBlock& block = mesh_.blocks[index];
    if (block.shape == Shape::Point) {
      elements_[index] = block.nodes;
      return;
    }
    const Pattern& nodes = pattern(block);
    const auto stride = std::size_t(nodes.values.rows());
    elements_[index].resize(block.size() * stride);
    for (std::size_t e = 0; e < block.size(); ++e)
      make_element(block, nodes, block.nodes.data() + e * std::size_t(nodes.values.cols()),
                   elements_[index].data() + e * stride);
  }

  void make_element(const ElementBlock& block, const Pattern& nodes, const std::int32_t* old, std::int32_t* made) {
    const reference::ShapeInfo& info = reference::info(block.shape);
    const std::int32_t known = shared_.count();
    std::copy_n(old, info.vertices, made);
    for (std::size_t e = 0; e < nodes.edges.size(); ++e)
      for (const PlacedNode& node : nodes.edges[e])
        made[node.local] = coded(shared_.edge_node(old[info.edges[e][0]], old[info.edges[e][1]], node.i));
    for (std::size_t f = 0; f < nodes.faces.size(); ++f) {
      const Vertices vertices = face_vertices(info.faces[f], old);
      for (const PlacedNode& node : nodes.faces[f])
        made[node.local] = coded(shared_.face_node(vertices, node.i, node.j));
    }
    for (const int local : nodes.interior) made[local] = coded(shared_.add());

    coordinates_.resize(3 * std::size_t(shared_.count()));
    entities_.resize(std::size_t(shared_.count()), {4, 0});
    const std::pair entity{info.dimension, block.entity};
    for (Eigen::Index local = info.vertices; local < nodes.values.rows(); ++local) {
      const std::int32_t fresh = coded(made[local]);
      entities_[std::size_t(fresh)] = std::min(entities_[std::size_t(fresh)], entity);
      if (fresh < known) continue;
      for (std::size_t k = 0; k < 3; ++k) {
        double sum = 0;
        for (Eigen::Index n = 0; n < nodes.values.cols(); ++n)
          sum += nodes.values(local, n) * mesh_.coordinates[3 * std::size_t(old[n]) + k];
        coordinates_[3 * std::size_t(fresh) + k] = sum;
      }
    }
  }

  // Keeps vertices and nodes without elements. New nodes come after the old nodes of their entity.
  void place_nodes(HighOrderMesh& result) {
    std::vector<bool> kept(mesh_.node_count(), true);
    for (const ElementBlock& block : mesh_.blocks)
      for (const std::int32_t node : block.nodes) kept[std::size_t(node)] = false;
    for (std::size_t b = 0; b < elements_.size(); ++b)
      for (const std::int32_t node : elements_[b])
        if (node >= 0) kept[std::size_t(node)] = true;

    std::vector<NodeBlock> blocks = mesh_.node_blocks;
    if (blocks.empty()) blocks.push_back({-1, 0, 0, std::int32_t(mesh_.node_count())});
    const bool classified =
        std::none_of(blocks.begin(), blocks.end(), [](const NodeBlock& b) { return b.dimension < 0; });
    std::map<std::pair<int, int>, std::vector<std::int32_t>> fresh_on;
    for (std::int32_t fresh = 0; fresh < shared_.count(); ++fresh)
      fresh_on[classified ? entities_[std::size_t(fresh)] : std::pair{-1, 0}].push_back(fresh);
    // New nodes come after the last block of their entity.
    std::map<std::pair<int, int>, std::size_t> last;
    for (std::size_t b = 0; b < blocks.size(); ++b)
      last[classified ? std::pair{blocks[b].dimension, blocks[b].entity} : std::pair{-1, 0}] = b;
    for (const auto& [entity, list] : fresh_on)
      if (last.try_emplace(entity, blocks.size()).second) blocks.push_back({entity.first, entity.second, 0, 0});

    old_place_.assign(mesh_.node_count(), kNone);
    fresh_place_.assign(std::size_t(shared_.count()), kNone);
    std::int64_t number = 0;
    for (const std::int64_t n : mesh_.node_numbers) number = std::max(number, n);
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      const NodeBlock old = blocks[b];
      NodeBlock placed{old.dimension, old.entity, std::int32_t(result.node_numbers.size()), 0};
      for (std::int32_t n = old.first; n < old.first + old.count; ++n) {
        if (!kept[std::size_t(n)]) continue;
        old_place_[std::size_t(n)] = std::int32_t(result.node_numbers.size());
        result.node_numbers.push_back(mesh_.node_numbers[std::size_t(n)]);
        const double* x = mesh_.coordinates.data() + 3 * std::size_t(n);
        result.coordinates.insert(result.coordinates.end(), x, x + 3);
      }
      const std::pair entity = classified ? std::pair{old.dimension, old.entity} : std::pair{-1, 0};
      if (last[entity] == b)
        for (const std::int32_t fresh : fresh_on[entity]) {
          fresh_place_[std::size_t(fresh)] = std::int32_t(result.node_numbers.size());
          result.node_numbers.push_back(++number);
          const double* x = coordinates_.data() + 3 * std::size_t(fresh);
          result.coordinates.insert(result.coordinates.end(), x, x + 3);
        }
      placed.count = std::int32_t(result.node_numbers.size()) - placed.first;
      if (placed.count > 0) result.node_blocks.push_back(placed);
    }
  }

  std::int32_t place_of(std::int32_t node) const {
    return node >= 0 ? old_place_[std::size_t(node)] : fresh_place_[std::size_t(coded(node))];
  }

  void place_elements(HighOrderMesh& result) {
    for (std::size_t b = 0; b < mesh_.blocks.size(); ++b) {
      ElementBlock block = mesh_.blocks[b];
      if (block.shape != Shape::Point) block.order = order_;
      block.nodes = elements_[b];
      for (std::int32_t& node : block.nodes) node = place_of(node);
      result.blocks.push_back(std::move(block));
    }
  }

  // Vertices keep their partners. The partner of a new node is at the same position on the edge or face between the
  // partners of its vertices.
  void place_link(HighOrderMesh& result, const PeriodicLink& link) {
    PeriodicLink placed = link;
    placed.nodes.clear();
    std::unordered_map<std::int32_t, std::int32_t> partner;
    for (const auto& [node, master] : link.nodes) {
      if (place_of(node) == kNone || place_of(master) == kNone) continue;
      partner.emplace(node, master);
      placed.nodes.emplace_back(place_of(node), place_of(master));
    }
    const auto partner_of = [&](std::int32_t vertex) {
      const auto found = partner.find(vertex);
      return found == partner.end() ? kNone : found->second;
    };
    std::vector<bool> seen(std::size_t(shared_.count()), false);
    const auto add = [&](std::int32_t fresh, std::int32_t master) {
      if (fresh == kNone || master == kNone || seen[std::size_t(fresh)]) return;
      seen[std::size_t(fresh)] = true;
      placed.nodes.emplace_back(place_of(coded(fresh)), place_of(coded(master)));
    };
    for (const ElementBlock& block : mesh_.blocks) {
      const reference::ShapeInfo& info = reference::info(block.shape);
      if (info.dimension != link.dimension || info.dimension == 0 || block.entity != link.entity) continue;
      const Pattern& nodes = pattern(block);
      for (std::size_t e = 0; e < block.size(); ++e) {
        const std::int32_t* old = block.nodes.data() + e * std::size_t(nodes.values.cols());
        for (std::size_t edge = 0; edge < nodes.edges.size(); ++edge) {
          const std::int32_t a = old[info.edges[edge][0]], b = old[info.edges[edge][1]];
          if (partner_of(a) == kNone || partner_of(b) == kNone) continue;
          for (const PlacedNode& node : nodes.edges[edge])
            add(shared_.edge_node(a, b, node.i, false), shared_.edge_node(partner_of(a), partner_of(b), node.i, false));
        }
        if (info.dimension != 2) continue;
        const Vertices vertices = face_vertices(info.faces[0], old);
        Vertices masters = vertices;
        for (std::int32_t& vertex : masters)
          if (vertex != kNone && (vertex = partner_of(vertex)) == kNone) masters.fill(kNone);
        if (masters[0] == kNone) continue;
        for (const PlacedNode& node : nodes.faces[0])
          add(shared_.face_node(vertices, node.i, node.j, false), shared_.face_node(masters, node.i, node.j, false));
      }
    }
    result.periodic.push_back(std::move(placed));
  }

  const HighOrderMesh& mesh_;
  int order_;
  SharedNodes shared_;
  std::map<std::pair<Shape, int>, Pattern> patterns_;
  std::vector<Provisional> elements_;
  std::vector<double> coordinates_;            // of the new nodes
  std::vector<std::pair<int, int>> entities_;  // of the new nodes: dimension, tag
  std::vector<std::int32_t> old_place_;        // the index of each old node in the result, or −1
  std::vector<std::int32_t> fresh_place_;      // the index of each new node in the result
};

}  // namespace

Expected<HighOrderMesh> change_order(const HighOrderMesh& mesh, int order) {
  if (order < 1 || order > kMaxOrder)
    return bad_option("The order is " + std::to_string(order) + "; give 1 to " + std::to_string(kMaxOrder) + ".");
  if (const auto checked = check_blocks(mesh); !checked) return tl::unexpected(checked.error());
  const bool same = std::all_of(mesh.blocks.begin(), mesh.blocks.end(), [&](const ElementBlock& block) {
    return block.shape == Shape::Point || block.order == order;
  });
  if (same) return mesh;
  std::int64_t nodes_of_cells = 0;
  for (const ElementBlock& block : mesh.blocks)
    nodes_of_cells += static_cast<std::int64_t>(block.size()) * reference::node_count(block.shape, order);
  if (nodes_of_cells > kMostNodes)  // cells share nodes, so there may be fewer
    if (const auto checked = check_counts(count(mesh, order).nodes(), 0); !checked)
      return tl::unexpected(checked.error());
  return OrderChange(mesh, order).apply();
}

}  // namespace varimesh
