#include "core/layers/grow/grown_mesh.h"

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include "core/base/index.h"
#include "core/layers/facet_table.h"
#include "core/layers/grow/extrusion.h"
#include "core/mesh/check.h"
#include "core/mesh/node_parameters.h"
#include "core/reference/basis.h"
#include "core/reference/nodes.h"

namespace varimesh::detail {
namespace {

using Vector = Eigen::Vector3d;
using Nodes = std::vector<std::int32_t>;

class Grower {
 public:
  Grower(const CheckedMesh& checked, std::span<const WallElement> walls, const CurvedSides& sides,
         std::span<const Vector> displacements)
      : mesh_(checked.mesh),
        facets_(checked.facets),
        walls_(walls),
        sides_(sides),
        displacements_(displacements),
        elements_(mesh_, mesh_.dimension - 1),
        cells_(mesh_, mesh_.dimension),
        result_(mesh_) {}

  Expected<HighOrderMesh> grow() {
    find_wall();
    const auto count = static_cast<std::int64_t>(result_.node_count() + rank_.size() * at(mesh_.order));
    if (const auto fits =
            check_counts(count, static_cast<std::int64_t>(mesh_.element_count(mesh_.dimension)) + std::ssize(walls_));
        !fits)
      return tl::unexpected(fits.error());
    entities_.assign(rank_.size() * at(mesh_.order), {4, 0});
    move_nodes();
    lift_elements();
    for (const WallElement& wall : walls_) add_cell(wall);
    for (auto& [key, block] : new_blocks_) result_.blocks.push_back(std::move(block));
    add_nodes();
    for (PeriodicLink& link : result_.periodic) link_nodes(link);
    std::erase_if(result_.foreign, [](const ForeignSection& section) {
      return section.name == "NodeData" || section.name == "ElementNodeData" || section.name == "ElementData";
    });
    return std::move(result_);
  }

 private:
  /// The node above a node of the wall.
  std::int32_t above(std::int32_t node, int level) const {
    if (level == 0) return node;
    return static_cast<std::int32_t>(mesh_.node_count() + rank_.at(node) * at(mesh_.order) + at(level) - 1);
  }

  const Eigen::MatrixXd& straight(Shape shape) {
    const auto found = straight_.find(shape);
    if (found != straight_.end()) return found->second;
    const reference::Points& nodes =
        reference::nodes(shape, mesh_.order, reference::NodeSet::Equispaced, mesh_.dimension);
    return straight_
        .emplace(shape, reference::basis_values(shape, 1, reference::NodeSet::Equispaced, mesh_.dimension, nodes))
        .first->second;
  }

  /// Ranks the nodes of the walls, and finds what grows from each.
  void find_wall() {
    for (const WallElement& wall : walls_) {
      is_wall_.insert(wall.element);
      const auto nodes = elements_.nodes(at(wall.element));
      const Shape shape = elements_.shape(at(wall.element));
      for (const auto& edge : reference::info(shape).edges)
        edges_.insert(std::minmax(nodes[at(edge[0])], nodes[at(edge[1])]));
      const Eigen::MatrixXd& weights = straight(shape);
      for (std::size_t k = 0; k < nodes.size(); ++k) {
        if (!rank_.emplace(nodes[k], rank_.size()).second) continue;
        Vector direction = Vector::Zero();
        double length = 0;
        for (Eigen::Index v = 0; v < weights.cols(); ++v) {
          const Vector& rise = displacements_[at(nodes[at(v)])];
          direction += weights(static_cast<Eigen::Index>(k), v) * rise.normalized();
          length += weights(static_cast<Eigen::Index>(k), v) * rise.norm();
        }
        rises_.emplace_back(length * direction.normalized());
      }
    }
  }

  /// Moves the nodes of cells with their vertices; those of walls stay.
  void move_nodes() {
    const NodesWithParameters before(mesh_);
    std::vector<char> seen(mesh_.node_count(), 0);
    for (const auto& [node, rank] : rank_) seen[at(node)] = 1;
    for (std::size_t cell = 0; cell < cells_.count(); ++cell) {
      const auto nodes = cells_.nodes(cell);
      const Eigen::MatrixXd& weights = straight(cells_.shape(cell));
      for (std::size_t k = 0; k < nodes.size(); ++k) {
        if (std::exchange(seen[at(nodes[k])], 1) != 0) continue;
        Vector by = Vector::Zero();
        for (Eigen::Index v = 0; v < weights.cols(); ++v)
          by += weights(static_cast<Eigen::Index>(k), v) * displacements_[at(nodes[at(v)])];
        if (by.isZero(0)) continue;
        const Vector to = sides_.nearest(nodes[k], point(mesh_, nodes[k]) + by);
        std::copy_n(to.data(), 3, &result_.coordinates[3 * at(nodes[k])]);
      }
    }
    before.forget_moved(result_);
  }

  bool is_of_wall(int dimension, std::int32_t number, std::span<const std::int32_t> nodes) const {
    if (dimension == mesh_.dimension) return false;
    if (dimension == mesh_.dimension - 1) return is_wall_.contains(number);
    if (dimension == 0) return rank_.contains(nodes[0]);
    return edges_.contains(std::minmax(nodes[0], nodes[1]));
  }

  /// Gives all elements that are not of the walls the nodes on top of the row, and adds elements on its sides.
  void lift_elements() {
    for (const ElementBlock& block : mesh_.blocks)
      for (const auto* numbers : {&block.numbers, &block.repeat_numbers})
        for (const std::int64_t number : *numbers) last_element_ = std::max(last_element_, number);
    std::array<std::int32_t, 4> numbers{};  // by dimension
    for (std::size_t b = 0; b < mesh_.blocks.size(); ++b) {
      const ElementBlock& old = mesh_.blocks[b];
      const int dimension = reference::info(old.shape).dimension;
      const std::size_t stride = old.size() == 0 ? 0 : old.nodes.size() / old.size();
      for (std::size_t e = 0; e < old.size(); ++e) {
        const std::span<const std::int32_t> nodes(old.nodes.data() + e * stride, stride);
        if (is_of_wall(dimension, numbers[at(dimension)]++, nodes)) continue;
        if (dimension < mesh_.dimension) add_sides(old, nodes);
        for (std::size_t k = 0; k < stride; ++k)
          if (rank_.contains(nodes[k])) result_.blocks[b].nodes[e * stride + k] = above(nodes[k], mesh_.order);
      }
    }
  }

  /// Adds an element below each side of this one that lies on the edge of a wall.
  void add_sides(const ElementBlock& block, std::span<const std::int32_t> nodes) {
    const reference::ShapeInfo& info = reference::info(block.shape);
    if (info.dimension == 1) {
      for (const int end : {0, 1})
        if (rank_.contains(nodes[at(end)])) add_element(block, Shape::Point, {nodes[at(end)]}, end == 1);
      return;
    }
    for (std::size_t side = 0; info.dimension == 2 && side < info.facets.size(); ++side) {
      Nodes edge;
      for (const int k : reference::facet_nodes(block.shape, mesh_.order, static_cast<int>(side)))
        edge.push_back(nodes[at(k)]);
      if (edges_.contains(std::minmax(edge[0], edge[1]))) add_element(block, Shape::Line, edge, false);
    }
  }

  void add_cell(const WallElement& wall) {
    const auto cell = at(std::ranges::upper_bound(facets_.first, wall.facet) - facets_.first.begin() - 1);
    const int local = wall.facet - facets_.first[cell];
    const Shape shape = reference::info(cells_.shape(cell)).facets[at(local)].shape;
    Nodes outward;
    for (const int k : reference::facet_nodes(cells_.shape(cell), mesh_.order, local))
      outward.push_back(cells_.nodes(cell)[at(k)]);
    Nodes base = outward;
    if (shape != Shape::Line) {
      const std::vector<int>& turned = reference::turned_nodes(shape, mesh_.order);
      for (std::size_t k = 0; k < turned.size(); ++k) base[k] = outward[at(turned[k])];
    }
    add_element(*cells_.range_of(cell).block, shape, base, false);
  }

  /// Adds the element that stands on these nodes of the wall to a block like this one.
  /// @param is_turned  a line begins on top
  void add_element(const ElementBlock& like, Shape base, const Nodes& nodes, bool is_turned) {
    const Extrusion& cell = extrusion(base, mesh_.order);
    const std::size_t b = std::size_t(&like - mesh_.blocks.data());
    ElementBlock& block = new_blocks_[{b, cell.shape}];
    if (block.size() == 0) {
      block = like;
      block.shape = cell.shape;
      block.order = mesh_.order;
      block.numbers.clear();
      block.nodes.clear();
      block.repeat_numbers.clear();
    }
    block.numbers.push_back(++last_element_);
    for (std::size_t r = 0; like.size() > 0 && r < like.repeat_numbers.size() / like.size(); ++r)
      block.repeat_numbers.push_back(++last_element_);
    const std::pair entity{reference::info(cell.shape).dimension, like.entity};
    for (const Extrusion::Node& node : cell.nodes) {
      const int level = is_turned ? mesh_.order - node.level : node.level;
      block.nodes.push_back(above(nodes[at(node.base)], level));
      if (level == 0) continue;
      auto& on = entities_[at(block.nodes.back()) - mesh_.node_count()];
      on = std::min(on, entity);
    }
  }

  /// Adds the nodes above the walls, classified on the lowest entity that has them.
  void add_nodes() {
    const std::size_t had = mesh_.node_count(), levels = at(mesh_.order);
    std::int64_t number = std::ranges::max(mesh_.node_numbers);
    const bool is_classified =
        std::ranges::all_of(mesh_.node_blocks, [](const NodeBlock& block) { return block.dimension >= 0; });
    std::map<std::pair<int, int>, std::vector<std::size_t>> by_entity;
    for (std::size_t fresh = 0; fresh < entities_.size(); ++fresh)
      by_entity[is_classified ? entities_[fresh] : std::pair{-1, 0}].push_back(fresh);
    std::vector<const std::int32_t*> wall_nodes(rank_.size());
    for (const auto& [node, rank] : rank_) wall_nodes[rank] = &node;
    std::vector<std::int32_t> place(had + entities_.size());
    for (std::size_t n = 0; n < had; ++n) place[n] = static_cast<std::int32_t>(n);
    for (const auto& [entity, list] : by_entity) {
      result_.node_blocks.push_back({entity.first, entity.second, static_cast<std::int32_t>(result_.node_count()),
                                     static_cast<std::int32_t>(list.size())});
      for (const std::size_t fresh : list) {
        place[had + fresh] = static_cast<std::int32_t>(result_.node_count());
        const std::size_t rank = fresh / levels;
        const double share = static_cast<double>(fresh % levels + 1) / static_cast<double>(levels);
        const Vector x = sides_.nearest(*wall_nodes[rank], point(mesh_, *wall_nodes[rank]) + share * rises_[rank]);
        result_.node_numbers.push_back(++number);
        result_.coordinates.insert(result_.coordinates.end(), x.data(), x.data() + 3);
      }
    }
    for (ElementBlock& block : result_.blocks)
      for (std::int32_t& node : block.nodes) node = place[at(node)];
    place_ = std::move(place);
  }

  void link_nodes(PeriodicLink& link) const {
    const std::size_t had = link.nodes.size();
    for (std::size_t pair = 0; pair < had; ++pair) {
      const auto [node, master] = link.nodes[pair];
      if (!rank_.contains(node) || !rank_.contains(master)) continue;
      for (int level = 1; level <= mesh_.order; ++level)
        link.nodes.emplace_back(place_[at(above(node, level))], place_[at(above(master, level))]);
    }
  }

  const HighOrderMesh& mesh_;
  const Facets& facets_;
  std::span<const WallElement> walls_;
  const CurvedSides& sides_;
  std::span<const Vector> displacements_;
  Cells elements_, cells_;
  HighOrderMesh result_;
  std::map<Shape, Eigen::MatrixXd> straight_;              ///< The basis of order 1 at the nodes.
  std::map<std::int32_t, std::size_t> rank_;               ///< Of the nodes of walls.
  std::vector<Vector> rises_;                              ///< By rank: from the wall to the top of the row.
  std::set<std::int32_t> is_wall_;                         ///< Elements.
  std::set<std::pair<std::int32_t, std::int32_t>> edges_;  ///< Of elements of walls.
  std::map<std::pair<std::size_t, Shape>, ElementBlock> new_blocks_;
  std::vector<std::pair<int, int>> entities_;  ///< Of the new nodes: dimension, tag.
  std::vector<std::int32_t> place_;
  std::int64_t last_element_ = 0;
};

}  // namespace

Expected<HighOrderMesh> grown_mesh(const CheckedMesh& mesh, std::span<const WallElement> walls,
                                   const CurvedSides& sides, std::span<const Vector> displacements) {
  return Grower(mesh, walls, sides, displacements).grow();
}

}  // namespace varimesh::detail
