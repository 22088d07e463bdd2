#include "core/optimise/door.h"

#include <Eigen/Core>
#include <cmath>
#include <limits>

#include "core/reference/basis.h"

namespace varimesh {
namespace {

using reference::NodePlace;
using reference::NodeSet;

/// The conversion with exact zeros where a node does not depend on another, instead of rounding errors.
Eigen::MatrixXd exact_conversion(Shape shape, int order, NodeSet from, NodeSet to, int ambient) {
  Eigen::MatrixXd matrix = reference::conversion(shape, order, from, to, ambient);
  const auto& places = reference::node_places(shape, order);
  for (int i = 0; i < matrix.rows(); ++i)
    for (int j = 0; j < matrix.cols(); ++j)
      if (!in_closure(reference::info(shape), places[j], places[i])) matrix(i, j) = 0;
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
  for (std::size_t i = 0; i < mesh.coordinates.size(); ++i) {
    low[i % 3] = std::min(low[i % 3], mesh.coordinates[i]);
    high[i % 3] = std::max(high[i % 3], mesh.coordinates[i]);
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

std::vector<double> positions_at_door(const HighOrderMesh& mesh, const Frame& frame) {
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

std::vector<double> coordinates_at_door(const HighOrderMesh& mesh, const Frame& frame,
                                        const std::vector<double>& before, const std::vector<double>& after) {
  const std::size_t d = mesh.dimension;
  std::vector<double> moved(before.size());
  for (std::size_t i = 0; i < before.size(); ++i) moved[i] = after[i] - before[i];
  std::vector<double> coordinates = mesh.coordinates;
  std::vector<bool> done(mesh.node_count(), false);
  for_each_cell(mesh, NodeSet::Optimised, NodeSet::Equispaced,
                [&](const std::int32_t* nodes, const Eigen::MatrixXd& to) {
                  for (int i = 0; i < to.rows(); ++i) {
                    if (done[nodes[i]]) continue;
                    done[nodes[i]] = true;
                    for (std::size_t k = 0; k < d; ++k) {
                      double sum = 0;
                      for (int j = 0; j < to.cols(); ++j) sum += to(i, j) * moved[nodes[j] * d + k];
                      if (sum != 0) coordinates[3 * static_cast<std::size_t>(nodes[i]) + k] += frame.diagonal * sum;
                    }
                  }
                });
  return coordinates;
}

}  // namespace varimesh
