#include "core/problem/problem_memory.h"

#include <algorithm>

#include "core/base/index.h"
#include "core/problem/node_conversion.h"
#include "core/problem/problem.h"
#include "core/reference/nodes.h"
#include "core/reference/quadrature.h"

namespace varimesh {
namespace {

constexpr std::int64_t kDouble = sizeof(double), kInt = sizeof(std::int32_t);

/// Entries of the conversion between the node sets that are not zero.
std::int64_t conversion_terms(Shape shape, int order) {
  const reference::ShapeInfo& info = reference::info(shape);
  const auto& places = reference::node_places(shape, order);
  std::int64_t terms = 0;
  for (const reference::NodePlace to : places)
    terms += std::ranges::count_if(places, [&](reference::NodePlace from) { return in_closure(info, from, to); });
  return terms;
}

}  // namespace

std::vector<SetSizes> set_sizes(const MeshCounts& counts, int quadrature_degree) {
  const int degree = quadrature_degree > 0 ? quadrature_degree : 2 * counts.order;
  std::vector<SetSizes> sets;
  for (std::size_t s = 0; s < kShapes; ++s) {
    if (counts.cells[s] == 0) continue;
    SetSizes set;
    set.shape = static_cast<Shape>(s);
    set.dimension = counts.dimension;
    set.order = counts.order;
    set.nodes = reference::node_count(set.shape, counts.order);
    set.points = static_cast<std::int64_t>(reference::quadrature(set.shape, counts.order, degree).weights.size());
    set.stride = (set.points + kPointPadding - 1) / kPointPadding * kPointPadding;
    set.affine = reference::info(set.shape).affine;
    set.count = counts.cells[s];
    sets.push_back(set);
  }
  return sets;
}

std::int64_t bytes_of_problem(const MeshCounts& counts, const std::vector<SetSizes>& sets, bool has_left_factor) {
  const std::int64_t d = counts.dimension, square = d * d;
  std::int64_t bytes = 0;
  for (const SetSizes& set : sets) {
    std::int64_t of_cell = kInt * (set.nodes + 2);                              // nodes, mesh_cell, cluster
    of_cell += kDouble * (square + 1) * (set.affine ? 1 : set.stride);          // inverse_target, measure
    of_cell += set.affine ? 0 : kDouble * (square + 1);                         // uniform_target
    of_cell += 2 * kDouble + 1 + (has_left_factor ? kDouble * square : 0);      // δ², the slope, unrepairable
    bytes += set.count * of_cell + kDouble * set.stride * (d * set.nodes + 1);  // tables
  }
  bytes += kDouble * d * counts.nodes();                         // positions
  bytes += (kInt + sizeof(std::int64_t)) * counts.free_nodes();  // free, offsets
  return bytes + static_cast<std::int64_t>(sizeof(Incidence)) * counts.free_in_cells.nodes(counts.order);
}

std::int64_t bytes_of_building(const MeshCounts& counts, const std::vector<SetSizes>& sets) {
  std::int64_t table = 0, cells = 0;
  for (const SetSizes& set : sets) {
    table = std::max(table, kDouble * set.points * set.nodes * set.dimension);  // gradients, before they are copied
    const std::int64_t vertices = reference::info(set.shape).vertices;
    // Clusters: the cells at each vertex, what waits, and pointers to the nodes and the set of each cell.
    cells += set.count * (kInt * (vertices + 4) + 4 * static_cast<std::int64_t>(sizeof(void*)));
  }
  return std::max(table, cells + 2 * kInt * counts.nodes());
}

std::int64_t bytes_of_deformation(const std::vector<SetSizes>& sets, bool keeps_function) {
  std::int64_t bytes = 0;
  for (const SetSizes& set : sets)
    bytes +=
        set.count * set.stride * kDouble * (std::int64_t{set.dimension} * set.dimension + (keeps_function ? 1 : 0));
  return bytes;
}

std::int64_t bytes_of_conversion(const MeshCounts& counts) {
  std::int64_t bytes = (kDouble * counts.dimension + std::int64_t{sizeof(std::int16_t)}) * counts.nodes();
  for (std::size_t s = 0; s < kShapes; ++s) {
    if (counts.cells[s] == 0) continue;
    const auto shape = static_cast<Shape>(s);
    const std::int64_t nodes = reference::node_count(shape, counts.order);
    bytes += counts.cells[s] * (2 * static_cast<std::int64_t>(sizeof(void*)) + kInt);
    bytes += 2 * kDouble * nodes * nodes;                          // reference::conversion(), both ways
    bytes += 2 * kDouble * conversion_terms(shape, counts.order);  // the same without zeros, with column numbers
  }
  return bytes;
}

}  // namespace varimesh
