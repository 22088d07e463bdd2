#include "core/problem/node_conversion.h"

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/reference/basis.h"

namespace varimesh {
namespace {

using reference::NodePlace;
using reference::NodeSet;

constexpr std::int32_t kCellsPerTask = 256;
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

/// Calls use(nodes of the cell, conversion) for every cell of the highest dimension.
template <class Use>
void for_each_cell(const HighOrderMesh& mesh, NodeSet from, NodeSet to, Use use) {
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != mesh.dimension) continue;
    const Eigen::MatrixXd matrix = exact_conversion(block.shape, block.order, from, to, mesh.dimension);
    for (std::size_t e = 0; e < block.size(); ++e) use(block.nodes.data() + e * matrix.rows(), matrix);
  }
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

Frame frame_of(const HighOrderMesh& mesh) {
  std::array<double, 3> low, high;
  low.fill(std::numeric_limits<double>::infinity());
  high.fill(-std::numeric_limits<double>::infinity());
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != mesh.dimension) continue;
    for (const std::int32_t node : block.nodes)
      for (std::size_t k = 0; k < 3; ++k) {
        const double x = mesh.coordinates[3 * static_cast<std::size_t>(node) + k];
        low[k] = std::min(low[k], x);
        high[k] = std::max(high[k], x);
      }
  }
  Frame frame;
  double square = 0;
  for (int k = 0; k < 3; ++k) {
    frame.centre[k] = 0.5 * (low[k] + high[k]);
    square += (high[k] - low[k]) * (high[k] - low[k]);
  }
  frame.diagonal = std::sqrt(square);
  return frame;
}

std::vector<double> solver_positions(const HighOrderMesh& mesh, const Frame& frame) {
  const int d = mesh.dimension;
  std::vector<double> relative(mesh.node_count() * d);
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    for (int k = 0; k < d; ++k) relative[n * d + k] = (mesh.coordinates[3 * n + k] - frame.centre[k]) / frame.diagonal;
  std::vector<double> positions = relative;
  std::vector<bool> done(mesh.node_count(), false);
  for_each_cell(mesh, NodeSet::Equispaced, NodeSet::Optimised,
                [&](const std::int32_t* nodes, const Eigen::MatrixXd& to) {
                  for (int i = 0; i < to.rows(); ++i) {
                    if (done[nodes[i]]) continue;
                    done[nodes[i]] = true;
                    for (int k = 0; k < d; ++k) {
                      double sum = 0;
                      for (int j = 0; j < to.cols(); ++j)
                        sum += to(i, j) * relative[static_cast<std::size_t>(nodes[j]) * d + k];
                      positions[static_cast<std::size_t>(nodes[i]) * d + k] = sum;
                    }
                  }
                });
  return positions;
}

NodeConversion::NodeConversion(const HighOrderMesh& mesh, const Frame& frame, std::vector<double> before)
    : mesh_(mesh), diagonal_(frame.diagonal), before_(std::move(before)), owned_begin_{0} {
  std::vector<bool> given(mesh.node_count(), false);
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != mesh.dimension || block.size() == 0) continue;
    const int nodes = reference::node_count(block.shape, block.order);
    Rows& rows = rows_[{block.shape, block.order}];
    if (rows.begin.empty()) {
      const Eigen::MatrixXd to =
          exact_conversion(block.shape, block.order, NodeSet::Optimised, NodeSet::Equispaced, mesh.dimension);
      for (int i = 0; i < nodes; ++i) {
        rows.begin.push_back(static_cast<int>(rows.terms.size()));
        for (int j = 0; j < nodes; ++j)
          if (to(i, j) != 0) rows.terms.push_back({j, to(i, j)});
      }
      rows.begin.push_back(static_cast<int>(rows.terms.size()));
    }
    for (std::size_t e = 0; e < block.size(); ++e) {
      const std::int32_t* cell = block.nodes.data() + e * static_cast<std::size_t>(nodes);
      cells_.push_back({cell, &rows});
      for (int i = 0; i < nodes; ++i) {
        if (given[cell[i]]) continue;
        given[cell[i]] = true;
        owned_.push_back(static_cast<std::int16_t>(i));
      }
      owned_begin_.push_back(static_cast<std::int32_t>(owned_.size()));
    }
  }
}

template <std::size_t d>
void NodeConversion::update_cell(const double* after, std::int32_t number, double* coordinates) const {
  const Cell& cell = cells_[number];
  const Term* const terms = cell.rows->terms.data();
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

void NodeConversion::update(const std::vector<double>& after, std::span<const std::int32_t> cells,
                            std::vector<double>& coordinates, const Team& team) const {
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
