#include "core/layers/split/cut_mesh.h"

#include <algorithm>
#include <array>
#include <map>
#include <string>
#include <unordered_map>
#include <utility>

#include "core/base/index.h"
#include "core/layers/split/cut_elements.h"
#include "core/mesh/changes/remove_nodes.h"
#include "core/mesh/check.h"
#include "core/reference/nodes.h"

namespace varimesh::detail {
namespace {

/// The code of a new node among the nodes of elements. Old nodes have their index.
constexpr std::int32_t coded(std::int32_t fresh) { return -1 - fresh; }

class MeshCutter {
 public:
  MeshCutter(const HighOrderMesh& mesh, const Topology& topology, const LayerCuts& cuts)
      : mesh_(mesh), cutter_(mesh, topology, cuts) {
    for (const ElementBlock& block : mesh.blocks)
      for (const auto* numbers : {&block.numbers, &block.repeat_numbers})
        for (const std::int64_t number : *numbers) last_element_ = std::max(last_element_, number);
  }

  Expected<CutMesh> cut(const std::vector<std::int32_t>& in_rows, LayerSplitReport& report) {
    blocks_.resize(mesh_.blocks.size());
    // Cells come first, since their maps give the nodes their places. Each node is classified on the lowest entity that
    // has it.
    std::int32_t cell = 0;
    std::vector<std::int32_t> parents;
    for (int dimension = mesh_.dimension; dimension >= 0; --dimension)
      for (std::size_t b = 0; b < mesh_.blocks.size(); ++b) {
        if (reference::info(mesh_.blocks[b].shape).dimension != dimension) continue;
        if (const auto done = cut_block(b); !done) return tl::unexpected(done.error());
        if (dimension != mesh_.dimension) continue;
        for (const int parts : parts_) {
          const bool is_cut = parts > 1;
          report.split += is_cut ? 1 : 0;
          if (is_cut && !std::ranges::binary_search(in_rows, cell)) ++report.beside;
          parents.insert(parents.end(), at(parts), cell++);
        }
        report.cells_after += static_cast<std::int64_t>(blocks_[b].size());
      }
    report.cells_before = cell;
    HighOrderMesh result;
    result.dimension = mesh_.dimension;
    result.order = mesh_.order;
    result.entities = mesh_.entities;
    result.physical_groups = mesh_.physical_groups;
    result.foreign = mesh_.foreign;
    drop_fields(result);
    place_nodes(result);
    for (ElementBlock& block : blocks_) {
      for (std::int32_t& node : block.nodes) node = place_of(node);
      result.blocks.push_back(std::move(block));
    }
    for (const PeriodicLink& link : mesh_.periodic) place_link(result, link);
    if (const auto checked = check_counts(static_cast<std::int64_t>(result.node_count()), report.cells_after); !checked)
      return tl::unexpected(checked.error());
    return CutMesh{std::move(result), std::move(parents)};
  }

 private:
  Expected<void> cut_block(std::size_t b) {
    const ElementBlock& old = mesh_.blocks[b];
    ElementBlock& made = blocks_[b];
    made = old;
    made.nodes.clear();
    made.numbers.clear();
    made.repeat_numbers.clear();
    parts_.assign(old.size(), 1);
    if (old.size() == 0) return {};
    const std::size_t stride = old.nodes.size() / old.size(), repeats = old.repeat_numbers.size() / old.size();
    for (std::size_t e = 0; e < old.size(); ++e) {
      const std::span<const std::int32_t> nodes(old.nodes.data() + e * stride, stride);
      made.numbers.push_back(old.numbers[e]);
      for (std::size_t r = 0; r < repeats; ++r) made.repeat_numbers.push_back(old.repeat_numbers[e * repeats + r]);
      const auto cut = cutter_.cut(old, e);
      if (!cut) return tl::unexpected(cut.error());
      if (cut->pattern == nullptr) {
        made.nodes.insert(made.nodes.end(), nodes.begin(), nodes.end());
        continue;
      }
      parts_[e] = cut->pattern->count;
      const std::vector<std::int32_t> points = nodes_of_points(*cut, nodes, old);
      for (const std::int32_t point : cut->pattern->nodes) made.nodes.push_back(points[at(point)]);
      for (int part = 1; part < cut->pattern->count; ++part) {
        made.numbers.push_back(++last_element_);
        for (std::size_t r = 0; r < repeats; ++r) made.repeat_numbers.push_back(++last_element_);
      }
    }
    return {};
  }

  /// The node at each point of a cut element: an old node, or a coded new one. Places those that are met first.
  std::vector<std::int32_t> nodes_of_points(const CutElement& cut, std::span<const std::int32_t> nodes,
                                            const ElementBlock& block) {
    const std::int32_t known = new_nodes_.count(), inner = new_nodes_.add(cut.pattern->inner);
    std::vector<std::int32_t> result;
    for (const CutPoint& point : cut.pattern->points) {
      if (point.node >= 0)
        result.push_back(nodes[at(point.node)]);
      else if (point.dimension == 3)
        result.push_back(coded(inner + point.index));
      else
        result.push_back(coded(new_nodes_.find(*cut.pattern, point, nodes.data())));
    }
    coordinates_.resize(3 * at(new_nodes_.count()));
    entities_.resize(at(new_nodes_.count()), {4, 0});
    const std::pair entity{reference::info(block.shape).dimension, block.entity};
    // Elements of a lower dimension find all their nodes made.
    const std::vector<double> places = known < new_nodes_.count() ? cutter_.places(cut, nodes) : std::vector<double>();
    for (std::size_t p = 0; p < result.size(); ++p) {
      if (result[p] >= 0) continue;
      const std::int32_t fresh = coded(result[p]);
      entities_[at(fresh)] = std::min(entities_[at(fresh)], entity);
      if (fresh >= known) std::copy_n(places.data() + 3 * p, 3, coordinates_.data() + 3 * at(fresh));
    }
    return result;
  }

  /// Old nodes that elements still have keep their order, and so do nodes that no element ever had. New ones come last.
  void place_nodes(HighOrderMesh& result) {
    std::vector<char> kept(mesh_.node_count(), 1);
    for (const ElementBlock& block : mesh_.blocks)
      for (const std::int32_t node : block.nodes) kept[at(node)] = 0;
    for (const ElementBlock& block : blocks_)
      for (const std::int32_t node : block.nodes)
        if (node >= 0) kept[at(node)] = 1;
    old_place_.assign(mesh_.node_count(), kNoNode);
    bool classified = true;
    for (const NodeBlock& old : mesh_.node_blocks) {
      classified = classified && old.dimension >= 0;
      NodeBlock block = old;
      block.first = static_cast<std::int32_t>(result.node_numbers.size());
      block.parameters.clear();
      for (std::int32_t n = old.first; n < old.first + old.count; ++n) {
        if (kept[at(n)] == 0) continue;
        old_place_[at(n)] = static_cast<std::int32_t>(result.node_numbers.size());
        const std::size_t each = old.parameters.size() / at(old.count), i = at(n - old.first);
        block.parameters.insert(block.parameters.end(), old.parameters.begin() + std::ptrdiff_t(i * each),
                                old.parameters.begin() + std::ptrdiff_t((i + 1) * each));
        put(result, mesh_.node_numbers[at(n)], mesh_.coordinates.data() + 3 * at(n));
      }
      block.count = static_cast<std::int32_t>(result.node_numbers.size()) - block.first;
      if (block.count > 0) result.node_blocks.push_back(std::move(block));
    }
    std::map<std::pair<int, int>, std::vector<std::int32_t>> by_entity;
    for (std::int32_t fresh = 0; fresh < new_nodes_.count(); ++fresh)
      by_entity[classified ? entities_[at(fresh)] : std::pair{-1, 0}].push_back(fresh);
    fresh_place_.resize(at(new_nodes_.count()));
    std::int64_t number = 0;
    for (const std::int64_t old : mesh_.node_numbers) number = std::max(number, old);
    for (const auto& [entity, list] : by_entity) {
      result.node_blocks.push_back({entity.first, entity.second, static_cast<std::int32_t>(result.node_numbers.size()),
                                    static_cast<std::int32_t>(list.size())});
      for (const std::int32_t fresh : list) {
        fresh_place_[at(fresh)] = static_cast<std::int32_t>(result.node_numbers.size());
        put(result, ++number, coordinates_.data() + 3 * at(fresh));
      }
    }
  }

  static void put(HighOrderMesh& result, std::int64_t number, const double* x) {
    result.node_numbers.push_back(number);
    result.coordinates.insert(result.coordinates.end(), x, x + 3);
  }

  std::int32_t place_of(std::int32_t node) const {
    return node >= 0 ? old_place_[at(node)] : fresh_place_[at(coded(node))];
  }

  /// Old nodes keep their partners. The partner of a new node is at the same place between the partners of vertices.
  void place_link(HighOrderMesh& result, const PeriodicLink& link) {
    PeriodicLink placed = link;
    placed.nodes.clear();
    const std::unordered_map<std::int32_t, std::int32_t> partner(link.nodes.begin(), link.nodes.end());
    for (const auto& [node, master] : link.nodes)
      if (old_place_[at(node)] != kNoNode && old_place_[at(master)] != kNoNode)
        placed.nodes.emplace_back(old_place_[at(node)], old_place_[at(master)]);
    std::vector<char> seen(at(new_nodes_.count()), 0);
    for (const ElementBlock& block : mesh_.blocks) {
      const reference::ShapeInfo& info = reference::info(block.shape);
      if (info.dimension != link.dimension || info.dimension == 0 || block.entity != link.entity) continue;
      for (std::size_t e = 0; e < block.size(); ++e) {
        const std::int32_t* nodes = block.nodes.data() + e * (block.nodes.size() / block.size());
        const auto cut = cutter_.cut(block, e);
        if (!cut || cut->pattern == nullptr) continue;
        std::array<std::int32_t, 8> masters{};
        for (int v = 0; v < info.vertices; ++v) {
          const auto found = partner.find(nodes[v]);
          masters[at(v)] = found == partner.end() ? kNoNode : found->second;
        }
        if (std::ranges::find(masters, kNoNode) != masters.end()) continue;
        for (const CutPoint& point : cut->pattern->points) {
          if (point.node >= 0 || point.dimension == 3) continue;
          const std::int32_t fresh = new_nodes_.find(*cut->pattern, point, nodes, false);
          const std::int32_t master = new_nodes_.find(*cut->pattern, point, masters.data(), false);
          if (fresh == kNoNode || master == kNoNode || seen[at(fresh)] != 0) continue;
          seen[at(fresh)] = 1;
          placed.nodes.emplace_back(fresh_place_[at(fresh)], fresh_place_[at(master)]);
        }
      }
    }
    result.periodic.push_back(std::move(placed));
  }

  const HighOrderMesh& mesh_;
  ElementCutter cutter_;
  NewNodes new_nodes_;
  std::vector<ElementBlock> blocks_;
  std::vector<int> parts_;  ///< Of the elements of the last block: into how many each is cut.
  std::int64_t last_element_ = 0;
  std::vector<double> coordinates_;            ///< Of the new nodes.
  std::vector<std::pair<int, int>> entities_;  ///< Of the new nodes: dimension, tag.
  std::vector<std::int32_t> old_place_;        ///< The index of each old node in the result, or −1.
  std::vector<std::int32_t> fresh_place_;
};

}  // namespace

Expected<CutMesh> cut_mesh(const HighOrderMesh& mesh, const Topology& topology, const LayerCuts& cuts,
                           const std::vector<std::int32_t>& in_rows, LayerSplitReport& report) {
  return MeshCutter(mesh, topology, cuts).cut(in_rows, report);
}

}  // namespace varimesh::detail
