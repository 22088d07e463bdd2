#include "core/repair/boundary/boundary_swaps.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <functional>
#include <iterator>
#include <map>
#include <optional>
#include <utility>

#include "core/base/index.h"
#include "core/curve/parts.h"
#include "core/curve/refined.h"
#include "core/mesh/changes/remove_nodes.h"
#include "core/mesh/connectivity.h"
#include "core/repair/node_key.h"
#include "core/repair/split.h"

namespace varimesh {
namespace {

using Ends = std::array<std::int32_t, 2>;

/// The worse of the new faces has at least this part of the shape of the worse of the old ones, and if these are
/// folded, at least kFlat. The shape is the area over the sum of the squares of the sides; equal sides have 0.14.
constexpr double kWorse = 0.2, kFlat = 0.02;
/// The cosine of the largest angle between the normals at four vertices and their mean. It is 0 halfway around a
/// cylinder.
constexpr double kBehind = -0.25;

Ends ends(std::int32_t a, std::int32_t b) { return {std::min(a, b), std::max(a, b)}; }

/// A cell that goes.
struct Swap {
  std::size_t cell = 0;
  int surface = -1;
  std::array<std::int32_t, 2> old_edge{}, new_edge{};  ///< Indices of the ends.
  std::size_t block = 0;                               ///< Of the boundary elements.
  std::array<std::size_t, 2> elements{};               ///< Opposite the ends of the new edge, the last end first.
};

class Swaps {
 public:
  Swaps(const HighOrderMesh& mesh, const Association& association, const std::vector<bool>& held, const Team& team)
      : mesh_(mesh),
        association_(association),
        held_(held),
        cells_(mesh, 3),
        facets_(facets(mesh, team)),
        parts_(mesh, association.surface_of_element) {
    for (const PeriodicLink& link : mesh.periodic)
      for (const auto& [node, master] : link.nodes) linked_.insert({node, master});
    for (std::size_t e = 0; e < parts_.edges.size(); ++e)
      if (!parts_.edges[e].surfaces.empty()) by_ends_.emplace(parts_.edges[e].ends, e);
    for (std::size_t b = 0; b < mesh.blocks.size(); ++b) add_elements(b);
    for (std::size_t c = 0; c < cells_.count(); ++c)
      if (cells_.shape(c) != Shape::Tetrahedron) others_.insert(cells_.nodes(c).begin(), cells_.nodes(c).end());
  }

  std::vector<Swap> find(std::span<const std::int64_t> wanted) const {
    std::vector<Swap> result;
    std::set<std::size_t> gaining;  // cells that get a face on the boundary
    const auto gains = [&](std::int32_t cell) { return cell >= 0 && gaining.contains(at(cell)); };
    for (std::size_t c = 0; c < cells_.count(); ++c) {
      if (!std::ranges::binary_search(wanted, cells_.number(c)) || gaining.contains(c)) continue;
      if (std::ranges::any_of(neighbours(c), gains)) continue;
      const std::optional<Swap> swap = of_cell(c);
      if (!swap || std::ranges::any_of(result, [&](const Swap& one) {
            return ends(one.new_edge[0], one.new_edge[1]) == ends(swap->new_edge[0], swap->new_edge[1]);
          }))
        continue;
      result.push_back(*swap);
      for (const std::int32_t other : neighbours(c))
        if (other >= 0) gaining.insert(at(other));
    }
    return result;
  }

  const Cells& cells() const { return cells_; }
  std::span<const std::int32_t> neighbours(std::size_t cell) const {
    return std::span(facets_.neighbour).subspan(at(facets_.first[cell]), 4);
  }

 private:
  void add_elements(std::size_t b) {
    const ElementBlock& block = mesh_.blocks[b];
    const auto& info = reference::info(block.shape);
    const auto stride = at(reference::node_count(block.shape, block.order));
    for (std::size_t e = 0; e < block.size() && (info.dimension == 1 || block.shape == Shape::Triangle); ++e) {
      const std::int32_t* nodes = &block.nodes[e * stride];
      if (info.dimension == 1)
        lines_.insert(ends(nodes[0], nodes[1]));
      else
        elements_[face_place(nodes[0], nodes[1], nodes[2])] = {b, e};
    }
  }

  std::optional<Swap> of_cell(std::size_t cell) const {
    if (cells_.shape(cell) != Shape::Tetrahedron) return std::nullopt;
    const auto nodes = cells_.nodes(cell).first(4);
    Swap swap{cell, -1, {-1, -1}, {-1, -1}, 0, {}};
    std::size_t found = 0;
    for (std::size_t v = 0; v < 4; ++v) {
      const auto element = elements_.find(face_place(nodes[(v + 1) % 4], nodes[(v + 2) % 4], nodes[(v + 3) % 4]));
      const bool is_outer = is_on_boundary(cell, nodes[v]);
      if (element == elements_.end() && !is_outer) {
        (swap.old_edge[0] < 0 ? swap.old_edge[0] : swap.old_edge[1]) = nodes[v];
        continue;
      }
      if (element == elements_.end() || !is_outer || found == 2) return std::nullopt;
      const auto [b, e] = element->second;
      const int surface = association_.surface_of_element[b][e];
      if (surface < 0 || (found == 1 && (surface != swap.surface || b != swap.block))) return std::nullopt;
      swap.surface = surface;
      swap.block = b;
      swap.new_edge[found] = nodes[v];
      swap.elements[found++] = e;
    }
    // With two faces on the boundary, the vertices opposite the other two are the ends of their common edge.
    return found == 2 && may_swap(swap) ? std::optional(swap) : std::nullopt;
  }

  bool is_on_boundary(std::size_t cell, std::int32_t opposite) const {
    const auto nodes = cells_.nodes(cell).first(4);
    const auto all = reference::info(Shape::Tetrahedron).facets;
    for (std::size_t f = 0; f < 4; ++f)
      if (std::ranges::none_of(all[f].vertices, [&](std::int8_t v) { return v >= 0 && nodes[at(v)] == opposite; }))
        return neighbours(cell)[f] < 0;
    return false;
  }

  bool may_swap(const Swap& swap) const {
    const Ends old_edge = ends(swap.old_edge[0], swap.old_edge[1]), fresh = ends(swap.new_edge[0], swap.new_edge[1]);
    if (lines_.contains(old_edge) || lines_.contains(fresh) || by_ends_.contains(fresh)) return false;
    for (const std::set<std::int32_t>& nodes : {std::cref(linked_), std::cref(others_)})
      for (const Ends& edge : {old_edge, fresh})
        if (nodes.contains(edge[0]) && nodes.contains(edge[1])) return false;
    int gaining = 0;  // cells that get a face on the boundary
    for (const std::int32_t other : neighbours(swap.cell)) {
      if (other < 0) continue;
      if (cells_.shape(at(other)) != Shape::Tetrahedron || has_face_on(at(other), swap.surface)) return false;
      ++gaining;
    }
    if (gaining != 2) return false;
    const detail::MeshEdge& edge = parts_.edges[by_ends_.at(old_edge)];
    for (const std::int32_t node : edge.inner) {
      if (!held_.empty() && held_[at(node)]) return false;
      if (edge.elements == 2 && lies_on_slit(node)) return false;
    }
    return fits(swap);
  }

  /// Whether a face of the tetrahedron lies on the surface of the geometry.
  bool has_face_on(std::size_t cell, int surface) const {
    const auto nodes = cells_.nodes(cell).first(4);
    for (std::size_t v = 0; v < 4; ++v) {
      const auto found = elements_.find(face_place(nodes[(v + 1) % 4], nodes[(v + 2) % 4], nodes[(v + 3) % 4]));
      if (found == elements_.end()) continue;
      if (association_.surface_of_element[found->second.first][found->second.second] == surface) return true;
    }
    return false;
  }

  /// Whether the node lies on a curve of which both sides are one surface. A seam of a periodic surface is no such
  /// curve.
  bool lies_on_slit(std::int32_t node) const {
    const NodeEntity& entity = association_.nodes[at(node)];
    if (entity.dimension != 1) return false;
    const std::vector<int>& around = association_.geometry.curves[at(entity.entity)].surfaces;
    if (around.size() != 2 || around[0] != around[1]) return true;
    const geometry::SurfaceShape& shape = *association_.geometry.surfaces[at(around[0])].shape;
    return !(shape.u_range().period > 0 || shape.v_range().period > 0);
  }

  /// Whether both new faces lie in the room of the old ones, and neither is much flatter, seen along the mean normal of
  /// the surface at the four vertices. No normal may point far to the other side: otherwise the faces go round a part
  /// that is as thin as they are long, and new ones would cut through it.
  bool fits(const Swap& swap) const {
    const geometry::SurfaceShape& shape = *association_.geometry.surfaces[at(swap.surface)].shape;
    SurfaceNodes own = association_.surfaces[at(swap.surface)];
    std::array<Eigen::Vector3d, 4> normals;
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    const std::array<std::int32_t, 4> vertices{swap.old_edge[0], swap.old_edge[1], swap.new_edge[0], swap.new_edge[1]};
    for (std::size_t k = 0; k < vertices.size(); ++k) {
      const auto [u, v] = own.of(vertices[k]);
      normals[k] = shape.normal(shape.at(u, v), u, v);
      if (!normals[k].allFinite()) normals[k].setZero();
      normal += normals[k];
    }
    normal.normalize();
    if (std::ranges::any_of(normals, [&](const Eigen::Vector3d& one) { return one.dot(normal) < kBehind; }))
      return false;
    const auto shape_of = [&](std::int32_t p, std::int32_t q, std::int32_t r) {
      const Eigen::Vector3d to_q = x(q) - x(p), to_r = x(r) - x(p);
      return normal.dot(to_q.cross(to_r)) / 2 / (to_q.squaredNorm() + to_r.squaredNorm() + (to_q - to_r).squaredNorm());
    };
    const auto [a, b] = swap.old_edge;
    const auto [c, d] = swap.new_edge;
    const std::array<double, 2> before{shape_of(a, b, c), shape_of(a, d, b)};
    const std::array<double, 2> after{shape_of(a, d, c), shape_of(d, b, c)};
    const double side = before[0] + before[1] >= 0 ? 1 : -1;  // on which c lies
    const double old = std::min(side * before[0], side * before[1]);
    const double fresh = std::min(side * after[0], side * after[1]);
    return fresh >= (old > 0 ? kWorse * old : kFlat);
  }

  Eigen::Vector3d x(std::int32_t node) const {
    return Eigen::Map<const Eigen::Vector3d>(&mesh_.coordinates[3 * at(node)]);
  }

  const HighOrderMesh& mesh_;
  const Association& association_;
  const std::vector<bool>& held_;
  const Cells cells_;
  const Facets facets_;
  const detail::MeshParts parts_;
  std::map<Ends, std::size_t> by_ends_;  // edges on the boundary
  std::map<SplitPlace, std::pair<std::size_t, std::size_t>> elements_;
  std::set<Ends> lines_;
  std::set<std::int32_t> linked_, others_;  // nodes of periodic links, and of cells that are no tetrahedra
};

/// Whether the vertices of a triangle, followed by the fourth vertex, are an even permutation of the cell's.
bool is_even(std::span<const std::int32_t> cell, const std::array<std::int32_t, 3>& triangle) {
  std::array<std::ptrdiff_t, 4> order{};
  std::ptrdiff_t fourth = 6;
  for (std::size_t k = 0; k < 3; ++k) {
    order[k] = std::ranges::find(cell.first(4), triangle[k]) - cell.begin();
    fourth -= order[k];
  }
  order[3] = fourth;
  int swapped = 0;
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t k = 0; k < i; ++k) swapped += order[k] > order[i] ? 1 : 0;
  return swapped % 2 == 0;
}

/// The nodes of a face of the cell, as a triangle with these vertices has them.
std::vector<std::int32_t> face_nodes(std::span<const std::int32_t> cell, int order,
                                     const std::array<std::int32_t, 3>& vertices) {
  const NodeWeights of_cell = node_weights(Shape::Tetrahedron, order), of_face = node_weights(Shape::Triangle, order);
  std::map<NodeKey, std::int32_t> known;
  for (std::size_t n = 0; n < of_cell.size(); ++n)
    known[node_key(vertex_nodes(Shape::Tetrahedron, cell.data()), of_cell[n])] = cell[n];
  std::vector<std::int32_t> result;
  for (const auto& weights : of_face)
    result.push_back(known.at(node_key({vertices[0], vertices[1], vertices[2], -1}, weights)));
  return result;
}

/// Gives the boundary elements of the cell that goes its other two faces.
void exchange_faces(HighOrderMesh& mesh, const Swap& swap, const Swaps& swaps) {
  ElementBlock& block = mesh.blocks[swap.block];
  const auto stride = at(reference::node_count(Shape::Triangle, mesh.order));
  const auto cell = swaps.cells().nodes(swap.cell);
  for (std::size_t k = 0; k < 2; ++k) {
    std::int32_t* element = &block.nodes[swap.elements[k] * stride];
    const bool was_even = is_even(cell, {element[0], element[1], element[2]});
    std::array<std::int32_t, 3> vertices{swap.old_edge[k], swap.new_edge[0], swap.new_edge[1]};
    for (const std::int32_t other : swaps.neighbours(swap.cell)) {
      if (other < 0) continue;
      const auto nodes = swaps.cells().nodes(at(other));
      const auto has = [&](std::int32_t vertex) { return std::ranges::count(nodes.first(4), vertex) > 0; };
      if (!std::ranges::all_of(vertices, has)) continue;
      if (is_even(nodes, vertices) != was_even) std::swap(vertices[1], vertices[2]);
      std::ranges::copy(face_nodes(nodes, mesh.order, vertices), element);
    }
  }
}

RepairStep step_of(const HighOrderMesh& mesh, const Association& association, const Swap& swap, std::int64_t cell) {
  const auto number = [&](std::int32_t node) { return std::to_string(mesh.node_numbers[at(node)]); };
  RepairStep step;
  step.kind = RepairStep::Kind::Swapped;
  for (const std::int32_t node : swap.old_edge) step.vertices.push_back(mesh.node_numbers[at(node)]);
  step.elements = {cell};
  step.sentence = "The boundary edge between nodes " + number(swap.old_edge[0]) + " and " + number(swap.old_edge[1]) +
                  " gave way to one between nodes " + number(swap.new_edge[0]) + " and " + number(swap.new_edge[1]) +
                  ": tetrahedron " + std::to_string(cell) + ", which had two faces on " +
                  association.geometry.surfaces[at(swap.surface)].text() + " of the model, was taken out.";
  return step;
}

/// The block of tetrahedra without the cells that have these numbers, in ascending order.
ElementBlock without_cells(const ElementBlock& block, const std::vector<std::int64_t>& gone) {
  const std::size_t count = block.size(), stride = block.nodes.size() / std::max<std::size_t>(count, 1);
  const std::size_t repeats = block.repeat_numbers.size() / std::max<std::size_t>(count, 1);
  ElementBlock left = block;
  left.numbers.clear();
  left.nodes.clear();
  left.repeat_numbers.clear();
  const auto copy = [](const auto& from, std::size_t e, std::size_t per, auto& to) {
    const auto first = from.begin() + static_cast<std::ptrdiff_t>(e * per);
    to.insert(to.end(), first, first + static_cast<std::ptrdiff_t>(per));
  };
  for (std::size_t e = 0; e < count; ++e) {
    if (std::ranges::binary_search(gone, block.numbers[e])) continue;
    copy(block.numbers, e, 1, left.numbers);
    copy(block.nodes, e, stride, left.nodes);
    copy(block.repeat_numbers, e, repeats, left.repeat_numbers);
  }
  return left;
}

/// Takes out the cells with these numbers, in ascending order, and blocks that are empty then.
/// @param surface_of_element  by block and element, as Association::surface_of_element; it keeps the blocks of the mesh
void erase_cells(HighOrderMesh& mesh, const std::vector<std::int64_t>& gone,
                 std::vector<std::vector<int>>& surface_of_element) {
  std::vector<ElementBlock> blocks;
  std::vector<std::vector<int>> surfaces;
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    ElementBlock& block = mesh.blocks[b];
    if (block.shape == Shape::Tetrahedron) block = without_cells(block, gone);
    if (block.size() == 0) continue;
    blocks.push_back(std::move(block));
    surfaces.push_back(std::move(surface_of_element[b]));
  }
  mesh.blocks = std::move(blocks);
  surface_of_element = std::move(surfaces);
}

/// Classifies nodes that are on boundary elements now, and were inside the mesh, on the entity of these elements.
void classify(HighOrderMesh& mesh, const std::map<std::int32_t, int>& entity_of) {
  std::vector<NodeBlock> blocks;
  for (const NodeBlock& block : mesh.node_blocks) {
    if (block.dimension != mesh.dimension) {
      blocks.push_back(block);
      continue;
    }
    for (std::int32_t n = block.first; n < block.first + block.count; ++n) {
      const auto found = entity_of.find(n);
      const int dimension = found == entity_of.end() ? block.dimension : 2;
      const int entity = found == entity_of.end() ? block.entity : found->second;
      if (n > block.first && blocks.back().dimension == dimension && blocks.back().entity == entity)
        ++blocks.back().count;
      else
        blocks.push_back({dimension, entity, n, 1, {}});
    }
  }
  mesh.node_blocks = std::move(blocks);
}

}  // namespace

std::size_t swap_boundary_edges(HighOrderMesh& mesh, Association& association, std::span<const std::int64_t> wanted,
                                const std::vector<bool>& held, std::vector<RepairStep>& steps,
                                std::set<std::string>& surfaces, const Team& team) {
  if (mesh.dimension != 3) return 0;
  const Swaps swaps(mesh, association, held, team);
  const std::vector<Swap> found = swaps.find(wanted);
  if (found.empty()) return 0;
  HighOrderMesh result = mesh;
  std::vector<std::int64_t> gone;
  std::vector<RepairStep> done;
  std::vector<bool> keep(mesh.node_count(), true);
  std::map<std::int32_t, int> entity_of;
  for (const Swap& swap : found) {
    exchange_faces(result, swap, swaps);
    gone.push_back(swaps.cells().number(swap.cell));
    done.push_back(step_of(mesh, association, swap, gone.back()));
    for (const std::int32_t node : swaps.cells().nodes(swap.cell)) keep[at(node)] = false;
    const ElementBlock& block = result.blocks[swap.block];
    const std::size_t stride = block.nodes.size() / block.size();
    for (const std::size_t e : swap.elements)
      for (std::size_t k = 0; k < stride; ++k) entity_of[block.nodes[e * stride + k]] = block.entity;
  }
  std::ranges::sort(gone);
  std::vector<std::vector<int>> surface_of_element = association.surface_of_element;
  erase_cells(result, gone, surface_of_element);
  for (const ElementBlock& block : result.blocks)
    for (const std::int32_t node : block.nodes) keep[at(node)] = true;
  classify(result, entity_of);
  std::vector<std::int32_t> before, now(mesh.node_count(), -1);
  for (std::size_t node = 0; node < keep.size(); ++node) {
    if (!keep[node]) continue;
    now[node] = static_cast<std::int32_t>(before.size());
    before.push_back(static_cast<std::int32_t>(node));
  }
  remove_nodes(result, keep);
  drop_fields(result);
  std::vector<Ends> edges;
  for (const Swap& swap : found)
    for (const auto& edge : {swap.old_edge, swap.new_edge}) edges.push_back(ends(now[at(edge[0])], now[at(edge[1])]));
  mesh = std::move(result);
  place_edges_anew(mesh, association, std::move(surface_of_element), before, edges, team);
  for (const Swap& swap : found) surfaces.insert(association.geometry.surfaces[at(swap.surface)].number_text());
  steps.insert(steps.end(), std::make_move_iterator(done.begin()), std::make_move_iterator(done.end()));
  return found.size();
}

}  // namespace varimesh
