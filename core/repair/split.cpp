// Finds the elements around each place, cuts them one after another, and finds shared nodes by their vertices.
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
#include "core/repair/node_key.h"

namespace varimesh {
namespace {

using reference::NodeSet;

/// Local numbers of those vertices of the place that the element has.
std::vector<int> local_vertices(const SplitPlace& place, const VertexNodes& vertices) {
  std::vector<int> result;
  for (int k = 0; k < vertex_count(place); ++k)
    for (int v = 0; v < 4; ++v)
      if (vertices[at(v)] == place[at(k)]) result.push_back(v);
  return result;
}

/// Whether all vertices of the element are on the place or beside it.
bool lies_beside(const SplitPlace& place, const VertexNodes& vertices, const std::vector<std::int32_t>& beside) {
  return std::ranges::all_of(vertices, [&](std::int32_t vertex) {
    return vertex < 0 || std::ranges::find(place, vertex) != place.end() ||
           std::ranges::find(beside, vertex) != beside.end();
  });
}

std::string sentence(const RepairStep& step, bool on_boundary, Shape shape) {
  const bool edge = step.kind == RepairStep::Kind::SplitEdge;
  const bool volume = shape == Shape::Tetrahedron;
  const std::string one = volume ? "tetrahedron" : "triangle", many = volume ? "tetrahedra" : "triangles";
  std::string text = std::string("The ") + (on_boundary ? "boundary" : "interior") +
                     (edge ? " edge between nodes " : " face between nodes ");
  for (std::size_t k = 0; k < step.vertices.size(); ++k)
    text += (k == 0 ? "" : k + 1 == step.vertices.size() ? " and " : ", ") + std::to_string(step.vertices[k]);
  return text + " was split at the new node " + std::to_string(step.node) + ": " +
         elements_text(step.elements, one, many) + (edge ? " in two" : " in three") +
         " (new: " + elements_text(step.new_elements, one, many) + ").";
}

bool is_simplex(Shape shape) { return shape == Shape::Line || shape == Shape::Triangle || shape == Shape::Tetrahedron; }

/// What a node is classified on: the dimension and the tag of an entity.
using NodeClass = std::pair<int, int>;

class Splitter {
 public:
  explicit Splitter(const HighOrderMesh& mesh) : result_(mesh), order_(mesh.order) {
    for (const std::int64_t number : mesh.node_numbers) last_node_ = std::max(last_node_, number);
    for (const ElementBlock& block : mesh.blocks) {
      for (const std::int64_t number : block.numbers) last_element_ = std::max(last_element_, number);
      for (const std::int64_t number : block.repeat_numbers) last_element_ = std::max(last_element_, number);
      if (is_simplex(block.shape) && !weights_.contains(block.shape))
        weights_[block.shape] = node_weights(block.shape, order_);
    }
    parents_.resize(mesh.blocks.size());
    classified_ = std::ranges::none_of(mesh.node_blocks, [](const NodeBlock& block) { return block.dimension < 0; });
  }

  HighOrderMesh split(std::span<const SplitPlace> places, std::vector<RepairStep>& steps, SplitParents* parents,
                      std::span<const std::vector<std::int32_t>> beside) {
    const std::vector<std::vector<Member>> members = members_of(places, beside);
    for (std::size_t i = 0; i < places.size(); ++i) {
      new_classes_.clear();
      const auto before = static_cast<std::int32_t>(result_.node_count());
      steps.push_back(cut(places[i], members[i]));
      classify(before, i == 0);
    }
    if (parents != nullptr) *parents = std::move(parents_);
    return std::move(result_);
  }

 private:
  struct Member {
    std::size_t block;
    std::size_t element;
  };

  const ElementBlock& block_of(const Member& member) const { return result_.blocks[member.block]; }
  int dimension_of(const Member& member) const { return reference::info(block_of(member).shape).dimension; }

  /// Puts the last nodes into blocks of nodes: into the last block if it is of the same entity and not one that came
  /// with the mesh, else into a new one.
  void classify(std::int32_t first, bool is_first) {
    for (std::size_t n = 0; n < new_classes_.size(); ++n) {
      const auto [dimension, entity] = new_classes_[n];
      NodeBlock& last = result_.node_blocks.back();
      if (!(is_first && n == 0) && last.dimension == dimension && last.entity == entity)
        ++last.count;
      else
        result_.node_blocks.push_back({dimension, entity, first + static_cast<std::int32_t>(n), 1});
    }
  }

  /// The elements of each place: those of lower dimension first. They are found by the place's vertex with the lowest
  /// index.
  std::vector<std::vector<Member>> members_of(std::span<const SplitPlace> places,
                                              std::span<const std::vector<std::int32_t>> beside) const {
    std::vector<std::vector<Member>> members(places.size());
    std::multimap<std::int32_t, std::size_t> by_vertex;
    for (std::size_t i = 0; i < places.size(); ++i) by_vertex.emplace(places[i][0], i);
    for (std::size_t b = 0; b < result_.blocks.size(); ++b) {
      const ElementBlock& block = result_.blocks[b];
      if (!is_simplex(block.shape)) continue;
      const std::size_t stride = weights_.at(block.shape).size();
      for (std::size_t e = 0; e < block.size(); ++e) {
        const VertexNodes vertices = vertex_nodes(block.shape, block.nodes.data() + e * stride);
        for (const std::int32_t vertex : vertices) {
          const auto [first, last] = by_vertex.equal_range(vertex);
          for (auto entry = first; entry != last; ++entry)
            if (const SplitPlace& place = places[entry->second];
                local_vertices(place, vertices).size() == at(vertex_count(place)) &&
                (beside.empty() || beside[entry->second].empty() ||
                 lies_beside(place, vertices, beside[entry->second])))
              members[entry->second].push_back({b, e});
        }
      }
    }
    for (std::vector<Member>& of_place : members)
      std::ranges::stable_sort(of_place, {}, [&](const Member& member) { return dimension_of(member); });
    return members;
  }

  /// Values of the parent's basis at the nodes of the part whose vertex `replaced` is the place's centre.
  const Eigen::MatrixXd& pattern(Shape shape, const std::vector<int>& vertices, int replaced) {
    std::vector<int> name = vertices;
    std::ranges::sort(name);
    name.push_back(replaced);
    name.push_back(static_cast<int>(shape));
    const auto [entry, is_new] = patterns_.try_emplace(name);
    if (!is_new) return entry->second;
    const auto& info = reference::info(shape);
    const NodeWeights& weights = weights_.at(shape);
    Eigen::MatrixXd corner(info.vertices, 3);
    for (int v = 0; v < info.vertices; ++v)
      for (int c = 0; c < 3; ++c) corner(v, c) = c < info.dimension ? info.vertex[at(v)][at(c)] : 0;
    Eigen::RowVector3d centre = Eigen::RowVector3d::Zero();
    for (const int v : vertices) centre += corner.row(v) / static_cast<double>(vertices.size());
    corner.row(replaced) = centre;
    reference::Points points = reference::Points::Zero(static_cast<Eigen::Index>(weights.size()), 3);
    for (std::size_t n = 0; n < weights.size(); ++n)
      for (int v = 0; v < info.vertices; ++v)
        points.row(static_cast<Eigen::Index>(n)) +=
            static_cast<double>(weights[n][at(v)]) / static_cast<double>(order_) * corner.row(v);
    entry->second = reference::basis_values(shape, order_, NodeSet::Equispaced, 3, points);
    return entry->second;
  }

  std::int32_t vacant_or_new_node(const NodeClass& of) {
    std::vector<std::int32_t>& vacant = vacant_[of];
    if (vacant.empty()) return new_node(of);
    const std::int32_t node = vacant.back();
    vacant.pop_back();
    return node;
  }

  /// The elements that are split at one place.
  struct Parents {
    std::vector<std::vector<std::int32_t>> nodes;
    std::vector<Eigen::MatrixXd> positions;
    std::map<NodeKey, std::int32_t> known;  // nodes that stay and nodes that are new, by vertices
    /// By sorted vertices: what the nodes between all of them are classified on. Without such a node, it is the element
    /// of lower dimension with these vertices that says it.
    std::map<VertexNodes, NodeClass> classes;
    NodeClass inside;
  };

  /// What the nodes between these vertices, and nowhere else, are classified on.
  static NodeClass class_of(const Parents& parents, VertexNodes vertices) {
    std::ranges::sort(vertices);
    const auto found = parents.classes.find(vertices);
    return found == parents.classes.end() ? parents.inside : found->second;
  }

  /// Nodes on the place, or between it and something else, become vacant: new nodes of the same entity take their
  /// numbers, the lowest first.
  Parents parents_of(const SplitPlace& place, const std::vector<Member>& members) {
    Parents parents;
    vacant_.clear();
    const Member& cell = *std::ranges::find_if(members, [&](const Member& member) { return is_cell(member); });
    parents.inside = classified_ ? NodeClass{result_.dimension, block_of(cell).entity} : NodeClass{-1, 0};
    for (const Member& member : members) {
      const NodeWeights& weights = weights_.at(block_of(member).shape);
      const auto* nodes = block_of(member).nodes.data() + member.element * weights.size();
      const VertexNodes vertices = vertex_nodes(block_of(member).shape, nodes);
      parents.nodes.emplace_back(nodes, nodes + weights.size());
      parents.positions.push_back(detail::node_positions(result_.coordinates, parents.nodes.back()));
      const std::vector<int> local = local_vertices(place, vertices);
      for (std::size_t n = 0; n < weights.size(); ++n) {
        VertexNodes between{-1, -1, -1, -1};
        for (std::size_t v = 0; v < 4; ++v)
          if (weights[n][v] > 0) between[v] = vertices[v];
        std::ranges::sort(between);
        if (std::ranges::any_of(local, [&](int v) { return weights[n][at(v)] == 0; })) {
          parents.known.emplace(node_key(vertices, weights[n]), nodes[n]);
          continue;
        }
        if (classified_) parents.classes.try_emplace(between, class_of_node(nodes[n]));
        vacant_[class_of(parents, between)].push_back(nodes[n]);
      }
      if (classified_ && !is_cell(member)) {  // also without nodes between all its vertices
        for (VertexNodes between : {vertices, vertex_nodes_of(place)}) {
          std::ranges::sort(between);
          parents.classes.try_emplace(between, dimension_of(member), block_of(member).entity);
        }
      }
    }
    for (auto& [of, vacant] : vacant_) {
      std::ranges::sort(vacant, std::greater<>());
      vacant.erase(std::unique(vacant.begin(), vacant.end()), vacant.end());
    }
    return parents;
  }

  NodeClass class_of_node(std::int32_t node) const {
    const auto after = std::ranges::upper_bound(result_.node_blocks, node, {}, &NodeBlock::first);
    return {std::prev(after)->dimension, std::prev(after)->entity};
  }

  bool is_cell(const Member& member) const { return dimension_of(member) == result_.dimension; }
  static VertexNodes vertex_nodes_of(const SplitPlace& place) { return {place[0], place[1], place[2], -1}; }

  RepairStep cut(const SplitPlace& place, const std::vector<Member>& members) {
    assert(!members.empty());
    RepairStep step;
    for (int k = 0; k < vertex_count(place); ++k) step.vertices.push_back(result_.node_numbers[at(place[at(k)])]);
    Parents parents = parents_of(place, members);
    const std::int32_t centre = new_node(class_of(parents, vertex_nodes_of(place)));  // its number is above all others
    step.node = result_.node_numbers[at(centre)];
    for (std::size_t m = 0; m < members.size(); ++m) {
      const Shape shape = block_of(members[m]).shape;
      const VertexNodes whole = vertex_nodes(shape, parents.nodes[m].data());
      const std::vector<int> local = local_vertices(place, whole);
      for (std::size_t part = 0; part < local.size(); ++part) {
        VertexNodes vertices = whole;
        vertices[at(local[part])] = centre;
        const Eigen::MatrixXd x = pattern(shape, local, local[part]) * parents.positions[m];
        put(members[m], part, nodes_of_part(shape, vertices, x, {place, centre}, parents), step);
      }
    }
    step.kind = vertex_count(place) == 2 ? RepairStep::Kind::SplitEdge : RepairStep::Kind::SplitFace;
    step.sentence = sentence(step, !is_cell(members.front()), block_of(members.back()).shape);
    return step;
  }

  struct Cut {
    const SplitPlace& place;
    std::int32_t centre;
  };

  std::vector<std::int32_t> nodes_of_part(Shape shape, const VertexNodes& vertices, const Eigen::MatrixXd& x,
                                          const Cut& cut, Parents& parents) {
    const NodeWeights& weights = weights_.at(shape);
    std::vector<std::int32_t> nodes(weights.size());
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      const NodeKey name = node_key(vertices, weights[n]);
      const auto [entry, is_new] = parents.known.try_emplace(name, -1);
      if (is_new) {
        entry->second = n < at(reference::info(shape).vertices)
                            ? vertices[n]
                            : vacant_or_new_node(class_of(parents, between_in_parent(name, cut)));
        for (int c = 0; c < 3; ++c)
          result_.coordinates[3 * at(entry->second) + at(c)] = x(static_cast<Eigen::Index>(n), c);
      }
      nodes[n] = entry->second;
    }
    return nodes;
  }

  /// The vertices of the parent between which a new node lies. Each part has one vertex of the place at most less than
  /// its parent, so there are at most four.
  static VertexNodes between_in_parent(const NodeKey& name, const Cut& cut) {
    VertexNodes result{-1, -1, -1, -1};
    std::size_t count = 0;
    const auto add = [&](std::int32_t vertex) {
      if (vertex >= 0 && vertex != cut.centre && std::ranges::find(result, vertex) == result.end())
        result[count++] = vertex;
    };
    for (const auto& [vertex, weight] : name) add(vertex);
    for (const std::int32_t vertex : cut.place) add(vertex);
    return result;
  }

  std::int32_t new_node(const NodeClass& of) {
    result_.coordinates.resize(result_.coordinates.size() + 3);
    result_.node_numbers.push_back(++last_node_);
    new_classes_.push_back(of);
    return static_cast<std::int32_t>(result_.node_count()) - 1;
  }

  /// Adds a part to the mesh. The first one takes the place and the number of its parent.
  void put(const Member& member, std::size_t part, const std::vector<std::int32_t>& nodes, RepairStep& step) {
    ElementBlock& block = result_.blocks[member.block];
    if (part == 0) {
      std::ranges::copy(nodes, block.nodes.begin() + static_cast<std::ptrdiff_t>(member.element * nodes.size()));
      if (is_cell(member)) step.elements.push_back(block.numbers[member.element]);
      return;
    }
    const std::size_t repeats = block.repeat_numbers.size() / block.size();
    block.nodes.insert(block.nodes.end(), nodes.begin(), nodes.end());
    block.numbers.push_back(++last_element_);
    for (std::size_t r = 0; r < repeats; ++r) block.repeat_numbers.push_back(++last_element_);
    parents_[member.block].push_back(member.element);
    if (is_cell(member)) step.new_elements.push_back(block.numbers.back());
  }

  HighOrderMesh result_;
  int order_;
  bool classified_ = false;
  std::map<Shape, NodeWeights> weights_;  // by shape: of each node, on the vertices
  std::map<std::vector<int>, Eigen::MatrixXd> patterns_;
  std::int64_t last_node_ = 0, last_element_ = 0;
  std::map<NodeClass, std::vector<std::int32_t>> vacant_;  // the lowest last
  std::vector<NodeClass> new_classes_;                     // of the nodes that the place under way has added
  SplitParents parents_;
};

}  // namespace

HighOrderMesh split(const HighOrderMesh& mesh, std::span<const SplitPlace> places, std::vector<RepairStep>& steps,
                    SplitParents* parents, std::span<const std::vector<std::int32_t>> beside) {
  return Splitter(mesh).split(places, steps, parents, beside);
}

}  // namespace varimesh
