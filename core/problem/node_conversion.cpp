#include "core/problem/node_conversion.h"

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/base/shared_work.h"
#include "core/mesh/bounding_box.h"
#include "core/reference/basis.h"

namespace varimesh {
namespace {

using reference::NodePlace;
using reference::NodeSet;

constexpr std::int32_t kCellsPerTask = 256;
/// Few cells are converted sooner than their coordinates go from rank to rank.
constexpr std::size_t kFewestToShare = 256;
constexpr std::size_t kCellsPerExchange = 1 << 13;  // whose coordinates go to all ranks at a time
constexpr std::size_t kNodesPerTask = 16384;
constexpr double kRounding = 1e-13;  // entries that should be 0 or 1 differ from it by less

/// The conversion without rounding errors in entries that are exactly 0 or 1: 0 if a node does not depend on another,
/// and 1 if the two node sets have the same node (up to order 2 they have all in common).
Eigen::MatrixXd exact_conversion(Shape shape, int order, NodeSet from, NodeSet to, int ambient) {
  Eigen::MatrixXd matrix = reference::conversion(shape, order, from, to, ambient);
  const auto& places = reference::node_places(shape, order);
  for (int i = 0; i < matrix.rows(); ++i)
    for (int j = 0; j < matrix.cols(); ++j)
      if (!in_closure(reference::info(shape), places[j], places[i]) || std::abs(matrix(i, j)) < kRounding)
        matrix(i, j) = 0;
      else if (std::abs(matrix(i, j) - 1) < kRounding)
        matrix(i, j) = 1;
  return matrix;
}

ConversionRows rows_of(const Eigen::MatrixXd& matrix) {
  ConversionRows rows{{0}, {}};
  for (int i = 0; i < matrix.rows(); ++i) {
    for (int j = 0; j < matrix.cols(); ++j)
      if (matrix(i, j) != 0) rows.terms.push_back({j, matrix(i, j)});
    rows.begin.push_back(static_cast<int>(rows.terms.size()));
  }
  return rows;
}

/// For every node the first cell that has it, in the mesh's order; the largest int if there is none.
std::vector<std::int32_t> first_cells(const HighOrderMesh& mesh, const Team& team) {
  std::vector<std::int32_t> first_cell(mesh.node_count(), std::numeric_limits<std::int32_t>::max());
  std::size_t first = 0;
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != mesh.dimension) continue;
    const auto stride = static_cast<std::size_t>(reference::node_count(block.shape, block.order));
    team.for_ranges(block.size(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin * stride; k < end * stride; ++k)
        lower_to(first_cell[block.nodes[k]], static_cast<std::int32_t>(first + k / stride), team);
    });
    first += block.size();
  }
  return first_cell;
}

}  // namespace

bool in_closure(const reference::ShapeInfo& shape, NodePlace part, NodePlace whole) {
  if (whole.dimension == shape.dimension) return true;
  if (part.dimension == whole.dimension) return part.index == whole.index;
  if (part.dimension > whole.dimension) return false;
  const auto is_vertex_of = [&](int vertex) {
    if (whole.dimension == 1) return shape.edges[whole.index][0] == vertex || shape.edges[whole.index][1] == vertex;
    for (const std::int8_t v : shape.faces[whole.index].vertices)
      if (v == vertex) return true;
    return false;
  };
  if (part.dimension == 0) return is_vertex_of(part.index);
  return is_vertex_of(shape.edges[part.index][0]) && is_vertex_of(shape.edges[part.index][1]);
}

Frame frame_of(const HighOrderMesh& mesh, const Team& team) {
  const BoundingBox all = bounding_box(mesh, team);
  Frame frame;
  double square = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    frame.centre[k] = 0.5 * (all.low[k] + all.high[k]);
    square += (all.high[k] - all.low[k]) * (all.high[k] - all.low[k]);
  }
  frame.diagonal = std::sqrt(square);
  return frame;
}

std::vector<double> solver_positions(const HighOrderMesh& mesh, const Frame& frame, const Team& team) {
  return solver_positions(mesh, mesh.coordinates, frame, team);
}

std::vector<double> solver_positions(const HighOrderMesh& mesh, std::span<const double> coordinates, const Frame& frame,
                                     const Team& team) {
  const auto d = static_cast<std::size_t>(mesh.dimension);
  UntouchedVector<double> relative(mesh.node_count() * d);
  std::vector<double> positions(mesh.node_count() * d);
  team.for_ranges(mesh.node_count(), kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n)
      for (std::size_t k = 0; k < d; ++k)
        positions[n * d + k] = relative[n * d + k] = (coordinates[3 * n + k] - frame.centre[k]) / frame.diagonal;
  });
  const std::vector<std::int32_t> first_cell = first_cells(mesh, team);
  std::size_t first = 0;
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != mesh.dimension || block.size() == 0) continue;
    const ConversionRows rows =
        rows_of(exact_conversion(block.shape, block.order, NodeSet::Equispaced, NodeSet::Optimised, mesh.dimension));
    const std::size_t stride = rows.begin.size() - 1;
    team.for_ranges(block.size(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t at = begin * stride; at < end * stride; ++at) {
        const std::int32_t* nodes = block.nodes.data() + at / stride * stride;
        const std::size_t i = at % stride, node = nodes[i];
        if (first_cell[node] != static_cast<std::int32_t>(first + at / stride)) continue;
        for (std::size_t k = 0; k < d; ++k) {
          double sum = 0;
          for (int t = rows.begin[i]; t < rows.begin[i + 1]; ++t)
            sum += rows.terms[t].factor * relative[static_cast<std::size_t>(nodes[rows.terms[t].node]) * d + k];
          positions[node * d + k] = sum;
        }
      }
    });
    first += block.size();
  }
  return positions;
}

NodeConversion::NodeConversion(const HighOrderMesh& mesh, const Frame& frame, const std::vector<double>& before,
                               const Team& team)
    : mesh_(mesh), diagonal_(frame.diagonal), before_(shared_copy(before, team)) {
  const std::vector<std::int32_t> first_cell = first_cells(mesh, team);
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != mesh.dimension || block.size() == 0) continue;
    ConversionRows& rows = rows_[{block.shape, block.order}];
    if (rows.begin.empty())
      rows =
          rows_of(exact_conversion(block.shape, block.order, NodeSet::Optimised, NodeSet::Equispaced, mesh.dimension));
    for (std::size_t e = 0; e < block.size(); ++e)
      cells_.push_back({block.nodes.data() + e * (rows.begin.size() - 1), &rows});
  }
  // Calls use(cell, local node) for the nodes that first occur in these cells, in order.
  const auto for_first = [&](std::size_t begin, std::size_t end, const auto& use) {
    for (std::size_t cell = begin; cell < end; ++cell)
      for (std::size_t i = 0; i + 1 < cells_[cell].rows->begin.size(); ++i)
        if (first_cell[cells_[cell].nodes[i]] == static_cast<std::int32_t>(cell)) use(cell, i);
  };
  owned_begin_.assign(cells_.size() + 1, 0);
  team.for_ranges(cells_.size(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
    for_first(begin, end, [&](std::size_t cell, std::size_t) { ++owned_begin_[cell]; });
  });
  owned_.resize(sums_before(owned_begin_));
  team.for_ranges(cells_.size(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
    std::int32_t next = owned_begin_[begin];
    for_first(begin, end, [&](std::size_t, std::size_t i) { owned_[next++] = static_cast<std::int16_t>(i); });
  });
}

template <std::size_t d>
void NodeConversion::update_cell(const double* after, std::int32_t number, double* coordinates) const {
  const Cell& cell = cells_[number];
  const ConversionRows::Term* const terms = cell.rows->terms.data();
  const int* const begin = cell.rows->begin.data();
  for (std::int32_t o = owned_begin_[number]; o < owned_begin_[number + 1]; ++o) {
    const int i = owned_[o];
    std::array<double, d> sum{};
    for (int t = begin[i]; t < begin[i + 1]; ++t) {
      const std::size_t at = static_cast<std::size_t>(cell.nodes[terms[t].node]) * d;
      for (std::size_t k = 0; k < d; ++k) sum[k] += terms[t].factor * (after[at + k] - before_[at + k]);
    }
    const std::size_t at = 3 * static_cast<std::size_t>(cell.nodes[i]);
    for (std::size_t k = 0; k < d; ++k) {
      const double start = mesh_.coordinates[at + k];
      coordinates[at + k] = sum[k] != 0 ? start + diagonal_ * sum[k] : start;
    }
  }
}

template <class Use>
void NodeConversion::for_owned(std::span<const std::int32_t> cells, const Use& use) const {
  for (const std::int32_t cell : cells)
    for (std::int32_t o = owned_begin_[cell]; o < owned_begin_[cell + 1]; ++o) {
      const std::size_t first = 3 * static_cast<std::size_t>(cells_[cell].nodes[owned_[o]]);
      for (int k = 0; k < mesh_.dimension; ++k) use(first + k);
    }
}

void NodeConversion::update(std::span<const double> after, std::span<const std::int32_t> cells,
                            std::span<double> coordinates, const Team& team, const Ranks& ranks) const {
  if (ranks.count() == 1 || cells.size() < kFewestToShare) return update_here(after, cells, coordinates, team);
  // In pieces, because a list of all coordinates would be one of the largest arrays of a run.
  for (; !cells.empty(); cells = cells.subspan(std::min(cells.size(), kCellsPerExchange)))
    update_together(after, cells.first(std::min(cells.size(), kCellsPerExchange)), coordinates, team, ranks);
}

void NodeConversion::update_together(std::span<const double> after, std::span<const std::int32_t> cells,
                                     std::span<double> coordinates, const Team& team, const Ranks& ranks) const {
  const auto [begin, end] = share_of(cells.size(), ranks);
  const std::span<const std::int32_t> mine = cells.subspan(begin, end - begin);
  update_here(after, mine, coordinates, team);
  std::vector<double> numbers;
  for_owned(mine, [&](std::size_t number) { numbers.push_back(coordinates[number]); });
  numbers = ranks.gather_everywhere(numbers);
  auto next = numbers.begin();
  for_owned(cells, [&](std::size_t number) { coordinates[number] = *next++; });
}

void NodeConversion::update_here(std::span<const double> after, std::span<const std::int32_t> cells,
                                 std::span<double> coordinates, const Team& team) const {
  team.for_each(static_cast<std::int32_t>(cells.size()), kCellsPerTask, [&](std::int32_t i) {
    if (mesh_.dimension == 2)
      update_cell<2>(after.data(), cells[i], coordinates.data());
    else
      update_cell<3>(after.data(), cells[i], coordinates.data());
  });
}

std::vector<double> file_coordinates(const HighOrderMesh& mesh, const Frame& frame, const std::vector<double>& before,
                                     const std::vector<double>& after) {
  std::vector<std::int32_t> cells(mesh.element_count(mesh.dimension));
  std::iota(cells.begin(), cells.end(), 0);
  std::vector<double> coordinates = mesh.coordinates;
  NodeConversion(mesh, frame, before).update(after, cells, coordinates, Team(1));
  return coordinates;
}

}  // namespace varimesh
