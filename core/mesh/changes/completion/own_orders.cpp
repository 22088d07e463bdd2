#include "core/mesh/changes/completion/own_orders.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <tuple>
#include <unordered_map>

#include "core/mesh/changes/completion/between_orders.h"
#include "core/mesh/changes/remove_nodes.h"
#include "core/mesh/changes/serendipity_elements.h"
#include "core/mesh/changes/shared_nodes.h"
#include "core/reference/nodes.h"
#include "core/reference/serendipity.h"

namespace varimesh {

namespace {

using detail::kNoNode;
using detail::Vertices;

/// How elements of the mesh's order become elements of a lower one.
struct Lowering : detail::CellNodes {
  int order = 0;
  std::vector<int> source;  ///< For each node of the lower element, the node of the higher one that it is, or −1.
  Eigen::MatrixXd down;     ///< Lower nodes × higher nodes: the values of the higher functions at the lower nodes.
  Eigen::MatrixXd up;       ///< Higher nodes × lower nodes: the values of the lower functions at the higher nodes.
};

Lowering make_lowering(Shape shape, int from, int to, bool serendipity, int ambient) {
  constexpr auto kSet = reference::NodeSet::Equispaced;
  const auto complete = static_cast<std::size_t>(reference::node_count(shape, to));
  const auto own = serendipity ? static_cast<std::size_t>(reference::serendipity_node_count(shape, to)) : complete;
  const auto high = static_cast<std::size_t>(reference::node_count(shape, from));
  Lowering made{detail::cell_nodes(shape, to, ambient), to, {}, {}, {}};
  made.source.assign(own, -1);
  const std::vector<int> low_of = detail::same_nodes(shape, to, own, from);
  for (std::size_t node = 0; node < low_of.size(); ++node)
    if (low_of[node] >= 0) made.source[static_cast<std::size_t>(low_of[node])] = static_cast<int>(node);
  made.down = detail::values_at(shape, from, high, reference::nodes(shape, to, kSet, ambient), ambient)
                  .topRows(static_cast<Eigen::Index>(own));
  made.up = detail::values_at(shape, to, own, reference::nodes(shape, from, kSet, ambient), ambient);
  return made;
}

class LoweringMesh {
 public:
  LoweringMesh(const HighOrderMesh& mesh, const std::vector<CameLower>& came) : mesh_(mesh), came_(came) {
    std::ranges::sort(came_, {}, [](const CameLower& run) { return std::pair(run.dimension, run.first); });
  }

  OwnOrders apply();

 private:
  using Marks = std::vector<const Lowering*>;  ///< By element of a block: what it becomes; null: it stays.

  const CameLower* how_it_came(int dimension, std::int64_t number) const;
  const Lowering* lowering(Shape shape, const CameLower& came);
  bool loses_nothing(const Lowering& lowering, const std::int32_t* nodes) const;
  Marks mark(const ElementBlock& block);
  /// Calls body(sorted vertices) for the sides of an element that may be elements of this dimension themselves.
  template <class Body>
  static void for_sides(Shape shape, const std::int32_t* nodes, int dimension, const Body& body);
  void let_follow(int dimension);
  void make_nodes(Shape shape, const Lowering& lowering, const std::int32_t* old, std::int32_t* made, int entity);
  std::int32_t new_node(const Lowering& lowering, const std::int32_t* old, int local);
  void make_blocks(const ElementBlock& block, const Marks& marks);
  void renumber();

  const HighOrderMesh& mesh_;
  std::vector<CameLower> came_;
  std::map<std::tuple<Shape, int, bool>, Lowering> lowerings_;
  std::vector<Marks> marks_;                                                         ///< By block.
  std::map<int, std::pair<detail::SharedNodes, std::vector<std::int32_t>>> shared_;  ///< By order: new nodes on sides.
  std::vector<std::pair<int, int>> entities_;                                        ///< Of the new nodes.
  OwnOrders result_;
};

const CameLower* LoweringMesh::how_it_came(int dimension, std::int64_t number) const {
  const auto after = std::ranges::upper_bound(came_, std::pair(dimension, number), {},
                                              [](const CameLower& run) { return std::pair(run.dimension, run.first); });
  if (after == came_.begin()) return nullptr;
  const CameLower& run = *std::prev(after);
  return run.dimension == dimension && number <= run.last ? &run : nullptr;
}

const Lowering* LoweringMesh::lowering(Shape shape, const CameLower& came) {
  if (came.serendipity && reference::serendipity_node_count(shape, came.order) == 0) return nullptr;
  const auto [at, is_new] = lowerings_.try_emplace({shape, came.order, came.serendipity});
  if (is_new) at->second = make_lowering(shape, mesh_.order, came.order, came.serendipity, mesh_.dimension);
  return &at->second;
}

bool LoweringMesh::loses_nothing(const Lowering& lowering, const std::int32_t* nodes) const {
  constexpr double kSame = 1e-12;
  Eigen::VectorXd at(lowering.up.rows());
  for (std::size_t k = 0; k < 3; ++k) {
    for (Eigen::Index n = 0; n < at.size(); ++n) at[n] = mesh_.coordinates[3 * static_cast<std::size_t>(nodes[n]) + k];
    if (!((lowering.up * (lowering.down * at) - at).cwiseAbs().maxCoeff() <= kSame * at.cwiseAbs().maxCoeff()))
      return false;
  }
  return true;
}

LoweringMesh::Marks LoweringMesh::mark(const ElementBlock& block) {
  Marks marks(block.size(), nullptr);
  if (block.shape == Shape::Point || block.order != mesh_.order || is_serendipity(block)) return marks;
  const std::size_t stride = nodes_per_element(block);
  for (std::size_t e = 0; e < block.size(); ++e) {
    const CameLower* came = how_it_came(reference::info(block.shape).dimension, block.numbers[e]);
    if (came == nullptr || came->order >= block.order) continue;
    const Lowering* how = lowering(block.shape, *came);
    // The partners of nodes that are not there yet are not known.
    const bool has_nodes = mesh_.periodic.empty() || block.order % came->order == 0;
    const bool fits = how != nullptr && has_nodes && loses_nothing(*how, block.nodes.data() + e * stride);
    if (fits) marks[e] = how;
    ++(fits ? result_.lowered : result_.raised);
  }
  return marks;
}

template <class Body>
void LoweringMesh::for_sides(Shape shape, const std::int32_t* nodes, int dimension, const Body& body) {
  const reference::ShapeInfo& info = reference::info(shape);
  const auto of_edge = [&](const auto& edge) {
    Vertices key{kNoNode, kNoNode, nodes[edge[0]], nodes[edge[1]]};
    std::ranges::sort(key);
    body(key);
  };
  if (info.dimension == dimension && dimension == 2) {
    Vertices key{kNoNode, kNoNode, kNoNode, kNoNode};
    std::copy_n(nodes, info.vertices, key.begin());
    std::ranges::sort(key);
    body(key);
  } else if (dimension == 1 && info.dimension == 1) {
    of_edge(std::array{0, 1});
  } else if (dimension == 1) {
    for (const auto& edge : info.edges) of_edge(edge);
  } else {
    for (const auto& face : info.faces) {
      Vertices key = detail::face_vertices(face, nodes);
      std::ranges::sort(key);
      body(key);
    }
  }
}

/// Elements of this dimension that are sides of cells are lowered only with one of these cells.
void LoweringMesh::let_follow(int dimension) {
  struct Beside {
    bool any = false, same = false;
    const Lowering* how = nullptr;
  };
  std::unordered_map<Vertices, Beside, detail::HashVertices> sides;
  const auto for_blocks = [&](int of, const auto& body) {
    for (std::size_t b = 0; b < mesh_.blocks.size(); ++b) {
      const ElementBlock& block = mesh_.blocks[b];
      if (block.shape == Shape::Point || reference::info(block.shape).dimension != of) continue;
      const std::size_t stride = nodes_per_element(block);
      for (std::size_t e = 0; e < block.size(); ++e)
        for_sides(block.shape, block.nodes.data() + e * stride, dimension,
                  [&](const Vertices& key) { body(key, marks_[b][e]); });
    }
  };
  for_blocks(dimension, [&](const Vertices& key, const Lowering* how) {
    if (how != nullptr) sides[key].how = how;
  });
  if (sides.empty()) return;
  for_blocks(mesh_.dimension, [&](const Vertices& key, const Lowering* how) {
    const auto side = sides.find(key);
    if (side == sides.end()) return;
    side->second.any = true;
    side->second.same |= how != nullptr && how->order == side->second.how->order;
  });
  for_blocks(dimension, [&](const Vertices& key, const Lowering*& how) {
    if (how == nullptr || !sides[key].any || sides[key].same) return;
    how = nullptr;
    --result_.lowered;
    ++result_.raised;
  });
}

std::int32_t LoweringMesh::new_node(const Lowering& lowering, const std::int32_t* old, int local) {
  std::array<double, 3> at{};
  for (std::size_t k = 0; k < 3; ++k)
    for (Eigen::Index n = 0; n < lowering.down.cols(); ++n)
      at[k] += lowering.down(local, n) * mesh_.coordinates[3 * static_cast<std::size_t>(old[n]) + k];
  result_.mesh.coordinates.insert(result_.mesh.coordinates.end(), at.begin(), at.end());
  entities_.emplace_back(4, 0);
  return static_cast<std::int32_t>(result_.mesh.node_count()) - 1;
}

void LoweringMesh::make_nodes(Shape shape, const Lowering& lowering, const std::int32_t* old, std::int32_t* made,
                              int entity) {
  const reference::ShapeInfo& info = reference::info(shape);
  const auto count = static_cast<int>(lowering.source.size());
  for (int local = 0; local < count; ++local) {
    const int source = lowering.source[static_cast<std::size_t>(local)];
    made[local] = source < 0 ? kNoNode : old[source];
  }
  auto& shared = shared_.try_emplace(lowering.order, lowering.order, std::vector<std::int32_t>{}).first->second;
  auto& numbers = shared.first;
  std::vector<std::int32_t>& node_of = shared.second;
  const auto take = [&](int local, std::int32_t number) {
    if (local >= count || made[local] >= 0) return;
    node_of.resize(std::max(node_of.size(), static_cast<std::size_t>(numbers.count())), kNoNode);
    std::int32_t& node = node_of[static_cast<std::size_t>(number)];
    if (node < 0) node = new_node(lowering, old, local);
    made[local] = node;
  };
  for (std::size_t e = 0; e < lowering.edges.size(); ++e)
    for (const detail::PlacedNode& node : lowering.edges[e])
      take(node.local, numbers.edge_node(old[info.edges[e][0]], old[info.edges[e][1]], node.i));
  if (info.dimension != mesh_.dimension || info.dimension == 3)  // nobody shares the inside of a 2-D cell
    for (std::size_t f = 0; f < lowering.faces.size(); ++f) {
      const Vertices vertices = detail::face_vertices(info.faces[f], old);
      for (const detail::PlacedNode& node : lowering.faces[f])
        take(node.local, numbers.face_node(vertices, node.i, node.j));
    }
  for (int local = 0; local < count; ++local) {
    if (made[local] < 0) made[local] = new_node(lowering, old, local);
    const auto node = static_cast<std::size_t>(made[local]);
    if (node >= mesh_.node_count())
      entities_[node - mesh_.node_count()] =
          std::min(entities_[node - mesh_.node_count()], std::pair(info.dimension, entity));
  }
}

/// The block, cut where the order of its elements changes.
void LoweringMesh::make_blocks(const ElementBlock& block, const Marks& marks) {
  const std::size_t stride = nodes_per_element(block);
  const std::size_t repeats = block.size() == 0 ? 0 : block.repeat_numbers.size() / block.size();
  std::size_t begin = 0;
  do {
    std::size_t end = begin;
    while (end < block.size() && marks[end] == marks[begin]) ++end;
    ElementBlock part{.shape = block.shape,
                      .order = block.order,
                      .entity = block.entity,
                      .physical = block.physical,
                      .numbers = {},
                      .nodes = {},
                      .partitions = block.partitions,
                      .repeat_numbers = {}};
    const auto slice = [&](const auto& all, std::size_t each) {
      return std::decay_t<decltype(all)>(all.begin() + static_cast<std::ptrdiff_t>(begin * each),
                                         all.begin() + static_cast<std::ptrdiff_t>(end * each));
    };
    part.numbers = slice(block.numbers, 1);
    part.repeat_numbers = slice(block.repeat_numbers, repeats);
    const Lowering* how = begin < end ? marks[begin] : nullptr;
    if (how == nullptr) {
      part.nodes = slice(block.nodes, stride);
    } else {
      part.order = how->order;
      part.nodes.resize((end - begin) * how->source.size());
      for (std::size_t e = begin; e < end; ++e)
        make_nodes(block.shape, *how, block.nodes.data() + e * stride,
                   part.nodes.data() + (e - begin) * how->source.size(), block.entity);
    }
    result_.mesh.blocks.push_back(std::move(part));
    begin = end;
  } while (begin < block.size());
}

/// Numbers the new nodes, and takes away those that no element has any more.
void LoweringMesh::renumber() {
  HighOrderMesh& mesh = result_.mesh;
  const auto first = mesh_.node_count();
  const std::vector<std::int32_t> place = detail::number_new_nodes(mesh, first, std::move(entities_));
  std::vector<bool> keep(mesh.node_count(), true);
  for (const ElementBlock& block : mesh_.blocks)
    for (const std::int32_t node : block.nodes) keep[static_cast<std::size_t>(node)] = false;
  for (ElementBlock& block : mesh.blocks)
    for (std::int32_t& node : block.nodes) {
      if (static_cast<std::size_t>(node) >= first) node = place[static_cast<std::size_t>(node) - first];
      keep[static_cast<std::size_t>(node)] = true;
    }
  remove_nodes(mesh, keep);
}

OwnOrders LoweringMesh::apply() {
  for (const ElementBlock& block : mesh_.blocks) marks_.push_back(mark(block));
  for (int dimension = 1; dimension < mesh_.dimension; ++dimension) let_follow(dimension);
  result_.mesh = mesh_;
  if (result_.lowered == 0) return std::move(result_);
  result_.mesh.blocks.clear();
  for (std::size_t b = 0; b < mesh_.blocks.size(); ++b) make_blocks(mesh_.blocks[b], marks_[b]);
  renumber();
  return std::move(result_);
}

}  // namespace

OwnOrders at_own_orders(const HighOrderMesh& mesh, const std::vector<CameLower>& came) {
  return LoweringMesh(mesh, came).apply();
}

}  // namespace varimesh
