#include "core/mesh/changes/completion/complete.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <tuple>

#include "core/mesh/changes/completion/between_orders.h"
#include "core/mesh/changes/remove_nodes.h"
#include "core/mesh/changes/serendipity_elements.h"
#include "core/mesh/changes/shared_nodes.h"
#include "core/reference/nodes.h"

namespace varimesh {

namespace {

using detail::kNoNode;
using detail::PlacedNode;
using detail::SharedNodes;

bool is_cell_or_side(const HighOrderMesh& mesh, const ElementBlock& block) {
  return block.size() > 0 && block.shape != Shape::Point &&
         reference::info(block.shape).dimension >= mesh.dimension - 1;
}

// === What becomes of one kind of elements ================================================================

/// The nodes of an element of the new order.
struct Pattern : detail::CellNodes {
  std::vector<int> source;  ///< For each node, the node of the old element that it is, or −1.
  Eigen::MatrixXd values;   ///< New nodes × old nodes: the values of the old functions.
};

Pattern make_pattern(const ElementBlock& block, int order, int ambient) {
  const reference::Points& at = reference::nodes(block.shape, order, reference::NodeSet::Equispaced, ambient);
  return {detail::cell_nodes(block.shape, order, ambient),
          detail::same_nodes(block.shape, block.order, nodes_per_element(block), order),
          detail::values_at(block.shape, block.order, nodes_per_element(block), at, ambient)};
}

// === The whole mesh ======================================================================================

class Completing {
 public:
  Completing(HighOrderMesh& mesh, int order, Allowance& allowance)
      : mesh_(mesh), order_(order), shared_(order), allowance_(allowance), first_new_(mesh.node_count()) {}

  /// False if there is too little memory.
  bool apply();
  std::vector<std::string> sentences() const;
  std::vector<CameLower> take_lower() { return std::move(lower_); }

 private:
  static constexpr std::size_t kSharedBytes = 96, kNodeBytes = 64;  // what an edge's and a new node take, at most

  bool changes(const ElementBlock& block) const {
    return block.size() > 0 && block.shape != Shape::Point && (block.order < order_ || is_serendipity(block));
  }
  const Pattern& pattern(const ElementBlock& block) {
    const auto [at, is_new] = patterns_.try_emplace({block.shape, block.order, nodes_per_element(block)});
    if (is_new) at->second = make_pattern(block, order_, mesh_.dimension);
    return at->second;
  }
  /// Calls body(block, its pattern, an element's nodes).
  template <class Body>
  void for_elements(ElementBlock& block, const Body& body) {
    const Pattern& nodes = pattern(block);
    const std::size_t stride = nodes_per_element(block);
    for (std::size_t e = 0; e < block.size(); ++e) body(nodes, block.nodes.data() + e * stride);
  }
  /// Calls visit(local number, number among the shared nodes) for the nodes of an element on edges and faces. `make`:
  /// whether new shared nodes get numbers; otherwise −1 stands for them.
  template <class Visit>
  void for_shared(Shape shape, const Pattern& nodes, const std::int32_t* old, bool make, const Visit& visit);

  bool claim(ElementBlock& block);
  void remember(ElementBlock& block);
  bool make_block(ElementBlock& block);
  void note_lower(const ElementBlock& block);
  void make_element(const ElementBlock& block, const Pattern& nodes, const std::int32_t* old, std::int32_t* made);
  void follow(const Pattern& nodes, const std::int32_t* old, int local, std::int32_t node);
  std::array<double, 3> place(const Pattern& nodes, const std::int32_t* old, int local) const;
  std::int32_t add_node(const std::array<double, 3>& at);
  void number_new_nodes();
  void link_new_nodes(PeriodicLink& link);
  void remove_unused(const std::vector<bool>& were_used);
  std::vector<bool> used() const;

  HighOrderMesh& mesh_;
  int order_;
  SharedNodes shared_;
  Allowance& allowance_;
  std::size_t first_new_;
  std::map<std::tuple<Shape, int, std::size_t>, Pattern> patterns_;
  std::vector<std::int32_t> node_of_;          // by number among the shared nodes: the node there, or −1
  std::vector<bool> stays_;                    // by number: the node is one of an element that does not change
  std::vector<std::pair<int, int>> entities_;  // of the new nodes: dimension, tag
  std::map<std::tuple<bool, int, Shape>, std::size_t> counts_;  // of changed elements: serendipity, order, shape
  std::vector<CameLower> lower_;
  std::size_t followers_ = 0;
};

template <class Visit>
void Completing::for_shared(Shape shape, const Pattern& nodes, const std::int32_t* old, bool make, const Visit& visit) {
  const reference::ShapeInfo& info = reference::info(shape);
  for (std::size_t e = 0; e < nodes.edges.size(); ++e)
    for (const PlacedNode& node : nodes.edges[e])
      visit(node.local, shared_.edge_node(old[info.edges[e][0]], old[info.edges[e][1]], node.i, make));
  if (info.dimension == mesh_.dimension && info.dimension == 2) return;  // nobody shares the inside of a 2-D cell
  for (std::size_t f = 0; f < nodes.faces.size(); ++f) {
    const detail::Vertices vertices = detail::face_vertices(info.faces[f], old);
    for (const PlacedNode& node : nodes.faces[f]) visit(node.local, shared_.face_node(vertices, node.i, node.j, make));
  }
}

/// Gives the edges and faces of the elements that change their numbers.
bool Completing::claim(ElementBlock& block) {
  bool fits = true;
  for_elements(block, [&](const Pattern& nodes, const std::int32_t* old) {
    const std::int32_t before = shared_.count();
    if (fits) for_shared(block.shape, nodes, old, true, [](int, std::int32_t) {});
    fits = fits && allowance_.take(static_cast<std::size_t>(shared_.count() - before) * kSharedBytes);
  });
  return fits;
}

/// Notes which nodes of the mesh lie on edges and faces of the elements that change.
void Completing::remember(ElementBlock& block) {
  for_elements(block, [&](const Pattern& nodes, const std::int32_t* old) {
    for_shared(block.shape, nodes, old, false, [&](int local, std::int32_t shared) {
      const int source = nodes.source[static_cast<std::size_t>(local)];
      if (shared == kNoNode || source < 0 || node_of_[static_cast<std::size_t>(shared)] >= 0) return;
      node_of_[static_cast<std::size_t>(shared)] = old[source];
      stays_[static_cast<std::size_t>(shared)] = !changes(block);
    });
  });
}

std::array<double, 3> Completing::place(const Pattern& nodes, const std::int32_t* old, int local) const {
  std::array<double, 3> at{};
  for (std::size_t k = 0; k < 3; ++k)
    for (Eigen::Index n = 0; n < nodes.values.cols(); ++n)
      at[k] += nodes.values(local, n) * mesh_.coordinates[3 * static_cast<std::size_t>(old[n]) + k];
  return at;
}

std::int32_t Completing::add_node(const std::array<double, 3>& at) {
  mesh_.coordinates.insert(mesh_.coordinates.end(), at.begin(), at.end());
  entities_.emplace_back(4, 0);
  return static_cast<std::int32_t>(mesh_.node_count()) - 1;
}

/// Counts a node of another element that is not where the element itself would have it.
void Completing::follow(const Pattern& nodes, const std::int32_t* old, int local, std::int32_t node) {
  constexpr double kSame = 1e-6;
  const std::array<double, 3> own = place(nodes, old, local);
  double distance = 0, size = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto x = [&](std::int32_t of) { return mesh_.coordinates[3 * static_cast<std::size_t>(of) + k]; };
    distance = std::max(distance, std::abs(own[k] - x(node)));
    size = std::max(size, std::abs(x(old[1]) - x(old[0])));
  }
  if (distance > kSame * size) ++followers_;
}

void Completing::make_element(const ElementBlock& block, const Pattern& nodes, const std::int32_t* old,
                              std::int32_t* made) {
  const auto count = static_cast<int>(nodes.source.size());
  for (int local = 0; local < count; ++local) {
    const int source = nodes.source[static_cast<std::size_t>(local)];
    made[local] = source < 0 ? kNoNode : old[source];
  }
  for_shared(block.shape, nodes, old, true, [&](int local, std::int32_t shared) {
    std::int32_t& node = node_of_[static_cast<std::size_t>(shared)];
    // An element of another order may have a node of its own where this one has one.
    if (made[local] >= 0 && (node == made[local] || !stays_[static_cast<std::size_t>(shared)])) return;
    if (node < 0)
      node = add_node(place(nodes, old, local));
    else if (static_cast<std::size_t>(node) < first_new_)
      follow(nodes, old, local, node);
    made[local] = node;
  });
  const std::pair entity{reference::info(block.shape).dimension, block.entity};
  for (int local = 0; local < count; ++local) {
    if (made[local] < 0) made[local] = add_node(place(nodes, old, local));
    const auto node = static_cast<std::size_t>(made[local]);
    if (node >= first_new_) entities_[node - first_new_] = std::min(entities_[node - first_new_], entity);
  }
}

void Completing::note_lower(const ElementBlock& block) {
  const int dimension = reference::info(block.shape).dimension;
  for (std::size_t e = 0; e < block.size(); ++e)
    if (e > 0 && block.numbers[e] == block.numbers[e - 1] + 1)
      ++lower_.back().last;
    else
      lower_.push_back({block.numbers[e], block.numbers[e], dimension, block.order, is_serendipity(block)});
}

bool Completing::make_block(ElementBlock& block) {
  const Pattern& nodes = pattern(block);
  const std::size_t stride = nodes.source.size();
  if (!allowance_.take(block.size() * stride * sizeof(std::int32_t))) return false;
  std::vector<std::int32_t> made(block.size() * stride);
  std::int32_t* to = made.data();
  bool fits = true;
  for_elements(block, [&](const Pattern&, const std::int32_t* old) {
    const std::size_t before = mesh_.node_count();
    if (fits) make_element(block, nodes, old, to);
    fits = fits && allowance_.take((mesh_.node_count() - before) * kNodeBytes) &&
           mesh_.node_count() <= static_cast<std::size_t>(kMostNodes);
    to += stride;
  });
  counts_[{is_serendipity(block), block.order, block.shape}] += block.size();
  if (block.order < order_) note_lower(block);
  block.nodes = std::move(made);
  block.order = order_;
  return fits;
}

/// Puts the new nodes in the order of their entities, and numbers them.
void Completing::number_new_nodes() {
  const std::vector<std::int32_t> place = detail::number_new_nodes(mesh_, first_new_, entities_);
  const auto move = [&](std::int32_t& node) {
    if (node >= 0 && static_cast<std::size_t>(node) >= first_new_)
      node = place[static_cast<std::size_t>(node) - first_new_];
  };
  for (ElementBlock& block : mesh_.blocks) std::ranges::for_each(block.nodes, move);
  std::ranges::for_each(node_of_, move);
}

/// The partner of a new node is at the same position on the edge or face between the partners of its vertices.
void Completing::link_new_nodes(PeriodicLink& link) {
  std::map<std::int32_t, std::int32_t> partner(link.nodes.begin(), link.nodes.end());
  for (ElementBlock& block : mesh_.blocks) {
    const reference::ShapeInfo& info = reference::info(block.shape);
    if (info.dimension != link.dimension || info.dimension == 0 || block.entity != link.entity) continue;
    for_elements(block, [&](const Pattern& nodes, const std::int32_t* own) {
      std::array<std::int32_t, 8> masters{};
      for (int v = 0; v < info.vertices; ++v) {
        const auto found = partner.find(own[v]);
        if (found == partner.end()) return;
        masters[static_cast<std::size_t>(v)] = found->second;
      }
      std::map<int, std::int32_t> of_masters;
      for_shared(block.shape, nodes, masters.data(), false,
                 [&](int local, std::int32_t shared) { of_masters[local] = shared; });
      for (const auto& [local, shared] : of_masters) {
        if (shared == kNoNode || node_of_[static_cast<std::size_t>(shared)] < 0) continue;
        if (partner.emplace(own[local], node_of_[static_cast<std::size_t>(shared)]).second)
          link.nodes.emplace_back(own[local], node_of_[static_cast<std::size_t>(shared)]);
      }
    });
  }
}

std::vector<bool> Completing::used() const {
  std::vector<bool> used(mesh_.node_count(), false);
  for (const ElementBlock& block : mesh_.blocks)
    for (const std::int32_t node : block.nodes) used[static_cast<std::size_t>(node)] = true;
  return used;
}

/// A raised element has no node where one of its old nodes was, if its order is no multiple of the old one.
void Completing::remove_unused(const std::vector<bool>& were_used) {
  std::vector<bool> keep = used();
  for (std::size_t node = 0; node < were_used.size(); ++node)
    if (!were_used[node]) keep[node] = true;
  if (std::ranges::count(keep, false) > 0) remove_nodes(mesh_, keep);
}

bool Completing::apply() {
  const std::vector<bool> were_used = used();
  for (ElementBlock& block : mesh_.blocks)
    if (changes(block) && !claim(block)) return false;
  node_of_.assign(static_cast<std::size_t>(shared_.count()), kNoNode);
  stays_.assign(node_of_.size(), false);
  for (const bool changing : {false, true})  // the nodes of elements that stay count first
    for (ElementBlock& block : mesh_.blocks)
      if (block.size() > 0 && block.shape != Shape::Point && block.order <= order_ && changes(block) == changing)
        remember(block);
  // From the highest dimension down: each node is finally classified on the lowest entity that has it.
  for (int dimension = mesh_.dimension; dimension > 0; --dimension)
    for (ElementBlock& block : mesh_.blocks)
      if (changes(block) && reference::info(block.shape).dimension == dimension && !make_block(block)) return false;
  number_new_nodes();
  for (PeriodicLink& link : mesh_.periodic) link_new_nodes(link);
  remove_unused(were_used);
  mesh_.order = order_;
  return true;
}

std::string listed(const std::vector<std::string>& parts) {
  std::string text;
  for (std::size_t i = 0; i < parts.size(); ++i)
    text += (i == 0 ? "" : i + 1 == parts.size() ? " and " : ", ") + parts[i];
  return text;
}

std::vector<std::string> Completing::sentences() const {
  std::vector<std::string> incomplete, lower, all;
  for (const auto& [kind, count] : counts_) {
    const auto& [serendipity, order, shape] = kind;
    const reference::ShapeInfo& info = reference::info(shape);
    (serendipity ? incomplete : lower)
        .push_back(std::to_string(count) + " " + std::string(count == 1 ? info.name : info.plural) + " of order " +
                   std::to_string(order));
  }
  const std::string order = std::to_string(order_);
  if (!incomplete.empty())
    all.push_back("Serendipity elements, which have no nodes inside their faces, became complete elements of order " +
                  order + " with the same geometry: " + listed(incomplete) + ".");
  if (!lower.empty())
    all.push_back("Elements of lower order became elements of order " + order +
                  " with the same geometry: " + listed(lower) + ".");
  if (!entities_.empty()) {
    const std::int64_t last = mesh_.node_numbers.back(), first = last - static_cast<std::int64_t>(entities_.size()) + 1;
    all.back() += entities_.size() == 1 ? " One new node has the number " + std::to_string(last) + "."
                                        : " The " + std::to_string(entities_.size()) + " new nodes have the numbers " +
                                              std::to_string(first) + " to " + std::to_string(last) + ".";
  }
  if (followers_ > 0)
    all.push_back(std::to_string(followers_) +
                  (followers_ == 1 ? " node of these elements lies" : " nodes of these elements lie") +
                  " on a curved side of an element beside them, which they follow.");
  return all;
}

/// The shapes that occur as serendipity elements of this order only.
std::vector<Shape> only_serendipity(const HighOrderMesh& mesh, int order) {
  std::set<Shape> some, others;
  for (const ElementBlock& block : mesh.blocks) {
    if (!is_cell_or_side(mesh, block)) continue;
    (is_serendipity(block) && block.order == order ? some : others).insert(block.shape);
  }
  std::vector<Shape> only;
  std::ranges::set_difference(some, others, std::back_inserter(only));
  return only;
}

}  // namespace

Expected<Completion> complete_elements(HighOrderMesh& mesh, Allowance& allowance) {
  int order = 0;
  bool all_are_complete = true;
  for (const ElementBlock& block : mesh.blocks)
    if (is_cell_or_side(mesh, block)) order = std::max(order, block.order);
  for (const ElementBlock& block : mesh.blocks)
    if (is_cell_or_side(mesh, block)) all_are_complete &= block.order == order && !is_serendipity(block);
  if (all_are_complete) return Completion();
  Completion done{only_serendipity(mesh, order), {}, {}};
  Completing completing(mesh, order, allowance);
  if (!completing.apply())
    return bad_input(
        "The mesh file cannot be read: with all elements complete and of order " + std::to_string(order) +
        " the mesh takes more than 8 times the memory of the file and 64 MiB; write it with elements of one order.");
  done.lower = completing.take_lower();
  done.sentences = completing.sentences();
  return done;
}

}  // namespace varimesh
