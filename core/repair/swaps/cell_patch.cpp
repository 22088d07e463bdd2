#include "core/repair/swaps/cell_patch.h"

#include <algorithm>
#include <map>
#include <string>
#include <unordered_map>

#include "core/base/index.h"
#include "core/diagnosis/elements_text.h"
#include "core/diagnosis/node_positions.h"
#include "core/mesh/changes/remove_nodes.h"
#include "core/mesh/changes/simplex_blend.h"

namespace varimesh {
namespace {

std::size_t stride_of(const ElementBlock& block) { return at(reference::node_count(block.shape, block.order)); }

/// Calls visit(place) for the edges and faces of a cell that lie between cells: edges in 2-D, edges and faces in 3-D.
template <class Visit>
void for_each_place(Shape shape, std::span<const std::int32_t> nodes, const Visit& visit) {
  const reference::ShapeInfo& info = reference::info(shape);
  for (const auto& edge : info.edges) visit(edge_place(nodes[at(edge[0])], nodes[at(edge[1])]));
  if (shape == Shape::Tetrahedron)
    for (const auto& facet : info.facets) {
      const auto& v = facet.vertices;
      visit(face_place(nodes[at(v[0])], nodes[at(v[1])], nodes[at(v[2])]));
    }
}

bool is_simplex(Shape shape) { return shape == Shape::Triangle || shape == Shape::Tetrahedron; }

/// Whether the vertices of the place are those between which the node lies.
bool lies_on(const VertexNodes& vertices, const std::array<std::int32_t, 4>& weights, const SplitPlace& place) {
  for (std::size_t v = 0; v < 4; ++v)
    if (vertices[v] >= 0 && (weights[v] > 0) != (std::ranges::find(place, vertices[v]) != place.end())) return false;
  return true;
}

/// Finds what the patch shares with other cells, and what must stay.
void mark_outside(CellPatch& patch, std::span<const std::int32_t> cells, const SplitRules& rules) {
  const auto is_outside = [&](std::int32_t cell) { return !std::ranges::binary_search(cells, cell); };
  for (std::size_t n = 0; n < patch.in_whole.size(); ++n)
    patch.shared[n] = std::ranges::any_of(rules.at_vertices().of(patch.in_whole[n]), is_outside);
  const Cells own(patch.mesh, patch.mesh.dimension);
  for (std::size_t c = 0; c < own.count(); ++c) {
    const Shape shape = own.shape(c);
    const auto nodes = own.nodes(c);
    if (!is_simplex(shape)) {  // nobody changes it, and nothing beside it
      for (const std::int32_t node : nodes) patch.shared[at(node)] = true;
      continue;
    }
    const NodeWeights weights = node_weights(shape, patch.mesh.order);
    const VertexNodes vertices = vertex_nodes(shape, nodes.data());
    for_each_place(shape, nodes, [&](const SplitPlace& place) {
      SplitPlace there = place;
      for (int k = 0; k < vertex_count(place); ++k) there[at(k)] = patch.in_whole[at(place[at(k)])];
      std::ranges::sort(std::span(there).first(at(vertex_count(place))));
      const bool outside = std::ranges::any_of(rules.cells_around(there), is_outside);
      if (outside || !rules.is_inside(there)) patch.kept.insert(place);
      if (!outside) return;
      for (std::size_t n = 0; n < nodes.size(); ++n)
        if (lies_on(vertices, weights[n], place)) patch.shared[at(nodes[n])] = true;
    });
  }
  for (std::size_t n = 0; n < patch.fixed.size(); ++n) patch.fixed[n] = patch.fixed[n] || patch.shared[n];
}

// ===== change =====

/// The nodes of the cells that go, by what lies where, and those of the cells that come.
class Changer {
 public:
  Changer(CellPatch& patch, ElementBlock& block) : patch_(patch), block_(block) {
    weights_ = node_weights(block.shape, block.order);
  }

  void know(std::size_t element) {
    const std::int32_t* nodes = block_.nodes.data() + element * weights_.size();
    const VertexNodes vertices = vertex_nodes(block_.shape, nodes);
    for (std::size_t n = 0; n < weights_.size(); ++n) known_.emplace(node_key(vertices, weights_[n]), nodes[n]);
  }

  /// Adds a cell; its new nodes are where the straight-sided cell has them.
  void add(const VertexNodes& vertices) {
    Eigen::MatrixXd corners(reference::info(block_.shape).vertices, 3);
    for (Eigen::Index v = 0; v < corners.rows(); ++v)
      for (Eigen::Index c = 0; c < 3; ++c) corners(v, c) = patch_.mesh.coordinates[3 * at(vertices[at(v)]) + at(c)];
    const Eigen::MatrixXd x = detail::simplex_blend(block_.shape, block_.order).linear * corners;
    for (std::size_t n = 0; n < weights_.size(); ++n) {
      const auto [entry, is_new] = known_.try_emplace(node_key(vertices, weights_[n]), -1);
      if (is_new) entry->second = new_node(x.row(static_cast<Eigen::Index>(n)));
      block_.nodes.push_back(entry->second);
    }
    block_.numbers.push_back(-++patch_.new_cells);
  }

  /// Lets new nodes on the faces and inside the last cells follow the edges and faces around them.
  void bend(std::size_t cells) {
    const detail::SimplexBlend& blend = detail::simplex_blend(block_.shape, block_.order);
    const std::size_t first = block_.size() - cells;
    for (std::size_t e = first; e < block_.size(); ++e)
      for (std::size_t f = 0; f < blend.faces.size(); ++f) follow(e, blend.faces[f], blend.on_face[f]);
    for (std::size_t e = first; e < block_.size(); ++e) follow(e, blend.inside, blend.in_cell);
  }

 private:
  std::int32_t new_node(const Eigen::RowVector3d& x) {
    patch_.mesh.coordinates.insert(patch_.mesh.coordinates.end(), {x[0], x[1], x[2]});
    patch_.mesh.node_numbers.push_back(0);
    ++patch_.mesh.node_blocks.front().count;
    patch_.in_whole.push_back(-1);
    patch_.shared.push_back(false);
    patch_.fixed.push_back(false);
    return static_cast<std::int32_t>(patch_.in_whole.size()) - 1;
  }

  void follow(std::size_t element, const std::vector<int>& local, const Eigen::MatrixXd& matrix) {
    if (local.empty()) return;
    const std::span<const std::int32_t> nodes(block_.nodes.data() + element * weights_.size(), weights_.size());
    if (patch_.in_whole[at(nodes[at(local.front())])] >= 0) return;
    const Eigen::MatrixXd& linear = detail::simplex_blend(block_.shape, block_.order).linear;
    const Eigen::MatrixXd x = detail::node_positions(patch_.mesh.coordinates, nodes);
    const Eigen::MatrixXd straight = linear * x.topRows(linear.cols());
    const Eigen::MatrixXd moved = straight(local, Eigen::all) + matrix * (x - straight);
    for (std::size_t i = 0; i < local.size(); ++i)
      for (std::size_t c = 0; c < 3; ++c)
        patch_.mesh.coordinates[3 * at(nodes[at(local[i])]) + c] = moved(static_cast<Eigen::Index>(i), at(c));
  }

  CellPatch& patch_;
  ElementBlock& block_;
  NodeWeights weights_;
  std::map<NodeKey, std::int32_t> known_;
};

/// Removes these elements of the block, given in ascending order.
void remove_elements(ElementBlock& block, std::span<const std::size_t> elements) {
  const std::size_t stride = stride_of(block),
                    repeats = block.repeat_numbers.size() / std::max<std::size_t>(block.size(), 1);
  std::size_t to = 0;
  auto gone = elements.begin();
  for (std::size_t e = 0; e < block.size(); ++e) {
    if (gone != elements.end() && *gone == e) {
      ++gone;
      continue;
    }
    std::copy_n(block.nodes.begin() + std::ptrdiff_t(e * stride), stride,
                block.nodes.begin() + std::ptrdiff_t(to * stride));
    std::copy_n(block.repeat_numbers.begin() + std::ptrdiff_t(e * repeats), repeats,
                block.repeat_numbers.begin() + std::ptrdiff_t(to * repeats));
    block.numbers[to++] = block.numbers[e];
  }
  block.nodes.resize(to * stride);
  block.numbers.resize(to);
  block.repeat_numbers.resize(to * repeats);
}

}  // namespace

// ===== take =====

CellPatch take_patch(const HighOrderMesh& whole, const Cells& all, std::span<const std::int32_t> cells,
                     const std::vector<bool>& fixed, const SplitRules& rules) {
  CellPatch patch;
  patch.mesh.dimension = whole.dimension;
  patch.mesh.order = whole.order;
  std::unordered_map<std::int32_t, std::int32_t> place;  // of nodes of the whole mesh in the patch
  std::vector<std::vector<std::int32_t>> of_block(whole.blocks.size());
  for (const std::int32_t cell : cells)
    of_block[at(all.range_of(at(cell)).block - whole.blocks.data())].push_back(cell);
  for (std::size_t b = 0; b < whole.blocks.size(); ++b) {
    const ElementBlock& old = whole.blocks[b];
    ElementBlock& block = patch.mesh.blocks.emplace_back();
    block.shape = old.shape;
    block.order = old.order;
    block.entity = old.entity;
    for (const std::int32_t cell : of_block[b]) {
      block.numbers.push_back(all.number(at(cell)));
      for (const std::int32_t node : all.nodes(at(cell))) {
        const auto [entry, is_new] = place.try_emplace(node, static_cast<std::int32_t>(patch.in_whole.size()));
        if (is_new) patch.in_whole.push_back(node);
        block.nodes.push_back(entry->second);
      }
    }
    patch.taken.insert(patch.taken.end(), block.numbers.begin(), block.numbers.end());
  }
  std::ranges::sort(patch.taken);
  for (const std::int32_t node : patch.in_whole) {
    patch.mesh.node_numbers.push_back(whole.node_numbers[at(node)]);
    for (std::size_t c = 0; c < 3; ++c) patch.mesh.coordinates.push_back(whole.coordinates[3 * at(node) + c]);
    patch.fixed.push_back(fixed[at(node)]);
  }
  patch.mesh.node_blocks.push_back({-1, 0, 0, static_cast<std::int32_t>(patch.in_whole.size())});
  patch.shared.assign(patch.in_whole.size(), false);
  mark_outside(patch, cells, rules);
  return patch;
}

// ===== change =====

CellPatch changed(const CellPatch& patch, const CellChange& change) {
  CellPatch result = patch;
  CellPatch::Done done{change.kind, {}, {}, {}};
  for (const std::int32_t vertex : change.place) done.vertices.push_back(patch.mesh.node_numbers[at(vertex)]);
  const Cells cells(patch.mesh, patch.mesh.dimension);
  const Cells::Range& range = cells.range_of(at(change.removed.front()));
  ElementBlock& block = result.mesh.blocks[at(range.block - patch.mesh.blocks.data())];
  Changer changer(result, block);
  std::vector<std::size_t> elements;
  for (const std::int32_t cell : change.removed) {
    elements.push_back(at(cell) - range.first);
    done.removed.push_back(cells.number(at(cell)));
    changer.know(elements.back());
  }
  remove_elements(block, elements);
  for (const VertexNodes& vertices : change.added) {
    changer.add(vertices);
    done.added.push_back(block.numbers.back());
  }
  changer.bend(change.added.size());
  result.done.push_back(std::move(done));
  return result;
}

// ===== put back =====

namespace {

/// Puts patches back one after another, and clears up at the end.
class Returner {
 public:
  explicit Returner(HighOrderMesh& whole) : whole_(whole), loose_(whole.node_count(), false) {
    for (const std::int64_t number : whole.node_numbers) last_node_ = std::max(last_node_, number);
    for (const ElementBlock& block : whole.blocks)
      for (const auto* numbers : {&block.numbers, &block.repeat_numbers})
        for (const std::int64_t number : *numbers) last_element_ = std::max(last_element_, number);
    classified_ = std::ranges::none_of(whole.node_blocks, [](const NodeBlock& block) { return block.dimension < 0; });
  }

  void put(const CellPatch& patch, std::vector<RepairStep>& steps) {
    const std::int64_t first = last_element_;
    last_element_ += patch.new_cells;
    std::vector<std::int32_t> place = patch.in_whole;
    for (std::size_t n = 0; n < place.size(); ++n)
      if (place[n] >= 0 && !patch.fixed[n])
        std::copy_n(patch.mesh.coordinates.data() + 3 * n, 3, whole_.coordinates.data() + 3 * at(place[n]));
    for (std::size_t b = 0; b < whole_.blocks.size(); ++b) put_block(patch, b, first, place);
    for (const CellPatch::Done& done : patch.done) steps.push_back(step_of(done, first, whole_));
  }

  /// Removes the nodes that no cell has any more.
  void clear() {
    for (const ElementBlock& block : whole_.blocks)
      for (const std::int32_t node : block.nodes) loose_[at(node)] = false;
    if (std::ranges::find(loose_, true) != loose_.end()) {
      loose_.flip();
      remove_nodes(whole_, loose_);
    }
    drop_fields(whole_);
  }

 private:
  void put_block(const CellPatch& patch, std::size_t b, std::int64_t first, std::vector<std::int32_t>& place) {
    const ElementBlock& from = patch.mesh.blocks[b];
    ElementBlock& to = whole_.blocks[b];
    if (reference::info(to.shape).dimension != whole_.dimension) return;
    const std::size_t stride = stride_of(to);
    const std::size_t repeats = to.size() == 0 ? 0 : to.repeat_numbers.size() / to.size();
    std::vector<std::int64_t> stays;
    for (const std::int64_t number : from.numbers)
      if (number > 0) stays.push_back(number);
    std::ranges::sort(stays);
    std::vector<std::size_t> gone;
    for (std::size_t e = 0; e < to.size(); ++e) {
      if (!std::ranges::binary_search(patch.taken, to.numbers[e])) continue;
      if (std::ranges::binary_search(stays, to.numbers[e])) continue;
      gone.push_back(e);
      for (std::size_t n = 0; n < stride; ++n) loose_[at(to.nodes[e * stride + n])] = true;
    }
    remove_elements(to, gone);
    for (std::size_t e = 0; e < from.size(); ++e) {
      if (from.numbers[e] > 0) continue;
      to.numbers.push_back(first - from.numbers[e]);
      for (std::size_t r = 0; r < repeats; ++r) to.repeat_numbers.push_back(++last_element_);
      for (std::size_t n = 0; n < stride; ++n) {
        const auto node = at(from.nodes[e * stride + n]);
        if (place[node] < 0) place[node] = new_node(patch.mesh.coordinates.data() + 3 * node, to.entity);
        to.nodes.push_back(place[node]);
      }
    }
  }

  std::int32_t new_node(const double* x, int entity) {
    const auto node = static_cast<std::int32_t>(whole_.node_count());
    whole_.coordinates.insert(whole_.coordinates.end(), x, x + 3);
    whole_.node_numbers.push_back(++last_node_);
    loose_.push_back(false);
    const NodeBlock block{classified_ ? whole_.dimension : -1, classified_ ? entity : 0, node, 1};
    NodeBlock& last = whole_.node_blocks.back();
    if (last.dimension == block.dimension && last.entity == block.entity && last.parameters.empty())
      ++last.count;
    else
      whole_.node_blocks.push_back(block);
    return node;
  }

  static RepairStep step_of(const CellPatch::Done& done, std::int64_t first, const HighOrderMesh& mesh) {
    const auto numbers = [&](std::vector<std::int64_t> list) {
      for (std::int64_t& number : list)
        if (number < 0) number = first - number;
      std::ranges::sort(list);
      return list;
    };
    RepairStep step;
    step.kind = done.kind;
    step.vertices = done.vertices;
    step.elements = numbers(done.removed);
    step.new_elements = numbers(done.added);
    const bool volume = mesh.dimension == 3;
    const auto name = [&](const std::vector<std::int64_t>& list) {
      return elements_text(list, volume ? "tetrahedron" : "triangle", volume ? "tetrahedra" : "triangles");
    };
    if (done.kind == RepairStep::Kind::Collapsed) {
      step.sentence = "Node " + std::to_string(step.vertices[0]) + " went to node " + std::to_string(step.vertices[1]) +
                      ", and the edge between them disappeared: ";
    } else {
      step.sentence = step.vertices.size() == 2 ? "The edge between nodes " : "The face between nodes ";
      for (std::size_t k = 0; k < step.vertices.size(); ++k)
        step.sentence += (k == 0                          ? ""
                          : k + 1 == step.vertices.size() ? " and "
                                                          : ", ") +
                         std::to_string(step.vertices[k]);
      step.sentence += " was swapped: ";
    }
    step.sentence += name(step.elements) + " became " + name(step.new_elements) + ".";
    return step;
  }

  HighOrderMesh& whole_;
  std::vector<bool> loose_;  // by node: a cell that it was of has gone
  std::int64_t last_node_ = 0, last_element_ = 0;
  bool classified_ = false;
};

}  // namespace

void put_back(HighOrderMesh& whole, std::span<const CellPatch> patches, std::vector<RepairStep>& steps) {
  Returner returner(whole);
  for (const CellPatch& patch : patches) returner.put(patch, steps);
  returner.clear();
}

}  // namespace varimesh
