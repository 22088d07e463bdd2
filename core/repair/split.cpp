// Finds the tetrahedra around each place, cuts them one after another, and finds shared nodes by their vertices.
#include "core/repair/split.h"

#include <algorithm>
#include <cassert>
#include <map>
#include <string>

#include "core/base/index.h"
#include "core/diagnosis/elements_text.h"
#include "core/diagnosis/node_positions.h"
#include "core/mesh/connectivity.h"
#include "core/reference/basis.h"

namespace varimesh {
namespace {

using reference::NodeSet;

/// A node by the vertices that it lies between, in ascending order, and its weight on each of them. The weights add up
/// to the order P.
using NodeKey = std::array<std::pair<std::int32_t, std::int32_t>, 4>;

constexpr std::pair<std::int32_t, std::int32_t> kNobody{-1, 0};

/// Local numbers of those vertices of the place that the tetrahedron has.
std::vector<int> local_vertices(const SplitPlace& place, const std::int32_t* nodes) {
  std::vector<int> result;
  for (int k = 0; k < vertex_count(place); ++k)
    for (int v = 0; v < 4; ++v)
      if (nodes[v] == place[at(k)]) result.push_back(v);
  return result;
}

std::string sentence(const RepairStep& step) {
  const bool edge = step.kind == RepairStep::Kind::SplitEdge;
  std::string text = edge ? "The interior edge between nodes " : "The interior face between nodes ";
  for (std::size_t k = 0; k < step.vertices.size(); ++k)
    text += (k == 0 ? "" : k + 1 == step.vertices.size() ? " and " : ", ") + std::to_string(step.vertices[k]);
  return text + " was split at the new node " + std::to_string(step.node) + ": " +
         elements_text(step.elements, "tetrahedron", "tetrahedra") + (edge ? " in two" : " in three") +
         " (new: " + elements_text(step.new_elements, "tetrahedron", "tetrahedra") + ").";
}

class Splitter {
 public:
  explicit Splitter(const HighOrderMesh& mesh) : result_(mesh), order_(mesh.order) {
    for (const auto& position : reference::lattice(Shape::Tetrahedron, order_))
      weights_.push_back({order_ - position[0] - position[1] - position[2], position[0], position[1], position[2]});
    for (const std::int64_t number : mesh.node_numbers) last_node_ = std::max(last_node_, number);
    for (const ElementBlock& block : mesh.blocks) {
      for (const std::int64_t number : block.numbers) last_element_ = std::max(last_element_, number);
      for (const std::int64_t number : block.repeat_numbers) last_element_ = std::max(last_element_, number);
    }
  }

  HighOrderMesh split(std::span<const SplitPlace> places, std::vector<RepairStep>& steps) {
    const std::vector<std::vector<Member>> members = members_of(places);
    const bool classified =
        std::ranges::none_of(result_.node_blocks, [](const NodeBlock& block) { return block.dimension < 0; });
    for (std::size_t i = 0; i < places.size(); ++i) {
      const auto before = static_cast<std::int32_t>(result_.node_count());
      steps.push_back(cut(places[i], members[i]));
      const auto added = static_cast<std::int32_t>(result_.node_count()) - before;
      const int entity = classified ? result_.blocks[members[i].front().block].entity : 0;
      classify(before, added, classified ? 3 : -1, entity, i == 0);
    }
    return std::move(result_);
  }

 private:
  struct Member {
    std::size_t block;
    std::size_t element;
  };

  /// Puts the last nodes into a block of nodes: into the last block if it is of the same entity and not the first that
  /// splitting makes, else into a new one.
  void classify(std::int32_t first, std::int32_t count, int dimension, int entity, bool is_first) {
    NodeBlock& last = result_.node_blocks.back();
    if (!is_first && last.dimension == dimension && last.entity == entity)
      last.count += count;
    else
      result_.node_blocks.push_back({dimension, entity, first, count});
  }

  /// The tetrahedra of each place. They are found by the place's vertex with the lowest index.
  std::vector<std::vector<Member>> members_of(std::span<const SplitPlace> places) const {
    std::vector<std::vector<Member>> members(places.size());
    std::multimap<std::int32_t, std::size_t> by_vertex;
    for (std::size_t i = 0; i < places.size(); ++i) by_vertex.emplace(places[i][0], i);
    for (std::size_t b = 0; b < result_.blocks.size(); ++b) {
      const ElementBlock& block = result_.blocks[b];
      if (block.shape != Shape::Tetrahedron) continue;
      for (std::size_t e = 0; e < block.size(); ++e) {
        const std::int32_t* nodes = block.nodes.data() + e * weights_.size();
        for (int v = 0; v < 4; ++v) {
          const auto [first, last] = by_vertex.equal_range(nodes[v]);
          for (auto entry = first; entry != last; ++entry)
            if (local_vertices(places[entry->second], nodes).size() == at(vertex_count(places[entry->second])))
              members[entry->second].push_back({b, e});
        }
      }
    }
    return members;
  }

  NodeKey key(const std::array<std::int32_t, 4>& vertices, std::size_t local) const {
    NodeKey result;
    for (std::size_t v = 0; v < 4; ++v)
      result[v] = weights_[local][v] > 0 ? std::pair{vertices[v], weights_[local][v]} : kNobody;
    std::ranges::sort(result);
    return result;
  }

  /// Values of the parent's basis at the nodes of the part whose vertex `replaced` is the place's centre.
  const Eigen::MatrixXd& pattern(const std::vector<int>& vertices, int replaced) {
    std::vector<int> name = vertices;
    std::ranges::sort(name);
    name.push_back(replaced);
    const auto [entry, is_new] = patterns_.try_emplace(name);
    if (!is_new) return entry->second;
    Eigen::Matrix<double, 4, 3> corner;
    for (int v = 0; v < 4; ++v)
      for (int c = 0; c < 3; ++c) corner(v, c) = reference::info(Shape::Tetrahedron).vertex[at(v)][at(c)];
    Eigen::RowVector3d centre = Eigen::RowVector3d::Zero();
    for (const int v : vertices) centre += corner.row(v) / static_cast<double>(vertices.size());
    corner.row(replaced) = centre;
    reference::Points points = reference::Points::Zero(static_cast<Eigen::Index>(weights_.size()), 3);
    for (std::size_t n = 0; n < weights_.size(); ++n)
      for (int v = 0; v < 4; ++v)
        points.row(static_cast<Eigen::Index>(n)) +=
            static_cast<double>(weights_[n][at(v)]) / static_cast<double>(order_) * corner.row(v);
    entry->second = reference::basis_values(Shape::Tetrahedron, order_, NodeSet::Equispaced, 3, points);
    return entry->second;
  }

  std::int32_t vacant_or_new_node() { return next_vacant_ < vacant_.size() ? vacant_[next_vacant_++] : new_node(); }

  /// The tetrahedra that are split at one place.
  struct Parents {
    std::vector<std::vector<std::int32_t>> nodes;
    std::vector<Eigen::MatrixXd> positions;
    std::map<NodeKey, std::int32_t> known;  // nodes that stay and nodes that are new, by vertices
  };

  /// Nodes on the place, or between it and something else, become vacant: new nodes take their numbers.
  Parents parents_of(const SplitPlace& place, const std::vector<Member>& members) {
    const std::size_t stride = weights_.size();
    Parents parents;
    vacant_.clear();
    next_vacant_ = 0;
    for (const Member& member : members) {
      const auto* nodes = result_.blocks[member.block].nodes.data() + member.element * stride;
      parents.nodes.emplace_back(nodes, nodes + stride);
      parents.positions.push_back(detail::node_positions(result_.coordinates, parents.nodes.back()));
      const std::vector<int> local = local_vertices(place, nodes);
      for (std::size_t n = 0; n < stride; ++n) {
        if (std::ranges::all_of(local, [&](int v) { return weights_[n][at(v)] > 0; }))
          vacant_.push_back(nodes[n]);
        else
          parents.known.emplace(key({nodes[0], nodes[1], nodes[2], nodes[3]}, n), nodes[n]);
      }
    }
    std::ranges::sort(vacant_);
    vacant_.erase(std::unique(vacant_.begin(), vacant_.end()), vacant_.end());
    return parents;
  }

  RepairStep cut(const SplitPlace& place, const std::vector<Member>& members) {
    assert(!members.empty());
    RepairStep step;
    for (int k = 0; k < vertex_count(place); ++k) step.vertices.push_back(result_.node_numbers[at(place[at(k)])]);
    Parents parents = parents_of(place, members);
    const std::int32_t centre = new_node();  // with a new number, above all others
    step.node = result_.node_numbers[at(centre)];
    for (std::size_t m = 0; m < members.size(); ++m) {
      const std::vector<int> local = local_vertices(place, parents.nodes[m].data());
      for (std::size_t part = 0; part < local.size(); ++part) {
        std::array<std::int32_t, 4> vertices{parents.nodes[m][0], parents.nodes[m][1], parents.nodes[m][2],
                                             parents.nodes[m][3]};
        vertices[at(local[part])] = centre;
        const Eigen::MatrixXd x = pattern(local, local[part]) * parents.positions[m];
        put(members[m], part, nodes_of_part(vertices, x, parents.known), step);
      }
    }
    step.kind = vertex_count(place) == 2 ? RepairStep::Kind::SplitEdge : RepairStep::Kind::SplitFace;
    step.sentence = sentence(step);
    return step;
  }

  std::vector<std::int32_t> nodes_of_part(const std::array<std::int32_t, 4>& vertices, const Eigen::MatrixXd& x,
                                          std::map<NodeKey, std::int32_t>& known) {
    std::vector<std::int32_t> nodes(weights_.size());
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      const auto [entry, is_new] = known.try_emplace(key(vertices, n), -1);
      if (is_new) {
        entry->second = n < 4 ? vertices[n] : vacant_or_new_node();
        for (int c = 0; c < 3; ++c)
          result_.coordinates[3 * at(entry->second) + at(c)] = x(static_cast<Eigen::Index>(n), c);
      }
      nodes[n] = entry->second;
    }
    return nodes;
  }

  std::int32_t new_node() {
    result_.coordinates.resize(result_.coordinates.size() + 3);
    result_.node_numbers.push_back(++last_node_);
    return static_cast<std::int32_t>(result_.node_count()) - 1;
  }

  /// Adds a part to the mesh. The first one takes the place and the number of its parent.
  void put(const Member& member, std::size_t part, const std::vector<std::int32_t>& nodes, RepairStep& step) {
    ElementBlock& block = result_.blocks[member.block];
    if (part == 0) {
      std::ranges::copy(nodes, block.nodes.begin() + static_cast<std::ptrdiff_t>(member.element * nodes.size()));
      step.elements.push_back(block.numbers[member.element]);
      return;
    }
    const std::size_t repeats = block.repeat_numbers.size() / block.size();
    block.nodes.insert(block.nodes.end(), nodes.begin(), nodes.end());
    block.numbers.push_back(++last_element_);
    for (std::size_t r = 0; r < repeats; ++r) block.repeat_numbers.push_back(++last_element_);
    step.new_elements.push_back(block.numbers.back());
  }

  HighOrderMesh result_;
  int order_;
  std::vector<std::array<std::int32_t, 4>> weights_;  // of each node of a tetrahedron, on its vertices
  std::map<std::vector<int>, Eigen::MatrixXd> patterns_;
  std::int64_t last_node_ = 0, last_element_ = 0;
  std::vector<std::int32_t> vacant_;
  std::size_t next_vacant_ = 0;
};

}  // namespace

HighOrderMesh split(const HighOrderMesh& mesh, std::span<const SplitPlace> places, std::vector<RepairStep>& steps) {
  return Splitter(mesh).split(places, steps);
}

}  // namespace varimesh
