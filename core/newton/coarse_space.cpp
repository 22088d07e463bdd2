#include "core/newton/coarse_space.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>

#include "core/reference/basis.h"
#include "core/reference/nodes.h"
#include "core/reference/quadrature.h"

namespace varimesh {
namespace {

using reference::NodePlace;
using reference::NodeSet;

/// Identifies a vertex, edge or face by its sorted vertices, filled up to four with −1, and the interior of a cell by
/// the cell's number.
using Key = std::array<std::int32_t, 4>;

struct KeyHash {
  std::size_t operator()(const Key& key) const {
    std::uint64_t hash = 0x9e3779b97f4a7c15U;
    for (const std::int32_t part : key)
      hash = (hash ^ static_cast<std::uint32_t>(part)) * 0xff51afd7ed558ccdU, hash ^= hash >> 32;
    return hash;
  }
};

Key key_of(const reference::ShapeInfo& shape, NodePlace place, const std::int32_t* nodes, std::int32_t cell) {
  Key key{-1, -1, -1, -1};
  int count = 0;
  if (place.dimension == shape.dimension) return {cell, -2, -1, -1};
  if (place.dimension == 0) key[count++] = nodes[place.index];
  if (place.dimension == 1)
    for (const std::int8_t vertex : shape.edges[place.index]) key[count++] = nodes[vertex];
  if (place.dimension == 2)
    for (const std::int8_t vertex : shape.faces[place.index].vertices)
      if (vertex >= 0) key[count++] = nodes[vertex];
  std::sort(key.begin(), key.begin() + count);
  return key;
}

/// For each node of the coarse cell, a node of the fine cell in the same vertex, edge, face or interior.
std::vector<int> fine_companions(Shape shape, int order, int fine_order) {
  const auto& coarse = reference::node_places(shape, order);
  const auto& fine = reference::node_places(shape, fine_order);
  std::vector<int> companions;
  for (const NodePlace& place : coarse)
    companions.push_back(static_cast<int>(
        std::find_if(fine.begin(), fine.end(),
                     [&](const NodePlace& p) { return p.dimension == place.dimension && p.index == place.index; }) -
        fine.begin()));
  return companions;
}

/// As CoarseSpace::Set::stiffness.
std::vector<float> mean_stiffness(Shape shape, int order, int d) {
  const reference::Quadrature rule = reference::quadrature(shape, order, 2 * order);
  const auto gradients = reference::basis_gradients(shape, order, NodeSet::Equispaced, d, rule.points);
  const Eigen::Index nodes = gradients[0].cols();
  std::vector<float> stiffness;
  for (Eigen::Index a = 0; a < nodes; ++a)
    for (Eigen::Index b = 0; b < nodes; ++b)
      for (int k = 0; k < d; ++k)
        for (int l = 0; l < d; ++l)
          stiffness.push_back(static_cast<float>(
              (rule.weights.array() * gradients[k].col(a).array() * gradients[l].col(b).array()).sum() /
              rule.weights.sum()));
  return stiffness;
}

/// Values of the coarse cell's basis at the nodes of the fine cell.
SparseRows values_at_nodes(const CellSet& cells, int order) {
  const Eigen::MatrixXd values =
      reference::basis_values(cells.shape, order, NodeSet::Equispaced, cells.dimension,
                              reference::nodes(cells.shape, cells.order, NodeSet::Optimised, cells.dimension));
  SparseRows rows;
  rows.begin.push_back(0);
  for (Eigen::Index n = 0; n < values.rows(); ++n) {
    for (Eigen::Index a = 0; a < values.cols(); ++a)
      if (std::abs(values(n, a)) >= 1e-12) {
        rows.column.push_back(static_cast<std::int32_t>(a));
        rows.factor.push_back(static_cast<float>(values(n, a)));
      }
    rows.begin.push_back(static_cast<std::int64_t>(rows.column.size()));
  }
  return rows;
}

}  // namespace

SparseRows transposed(const SparseRows& rows, std::int32_t columns) {
  SparseRows out;
  out.begin.assign(columns + 1, 0);
  for (const std::int32_t column : rows.column) ++out.begin[column + 1];
  for (std::int32_t c = 0; c < columns; ++c) out.begin[c + 1] += out.begin[c];
  out.column.resize(rows.column.size());
  out.factor.resize(rows.factor.size());
  std::vector<std::int64_t> next(out.begin.begin(), out.begin.end() - 1);
  for (std::size_t row = 0; row + 1 < rows.begin.size(); ++row)
    for (std::int64_t i = rows.begin[row]; i < rows.begin[row + 1]; ++i) {
      const std::int64_t at = next[rows.column[i]]++;
      out.column[at] = static_cast<std::int32_t>(row);
      out.factor[at] = rows.factor[i];
    }
  return out;
}

CoarseSpace coarse_space(const Problem& problem, int order) {
  CoarseSpace space;
  space.order = order;
  std::vector<bool> is_free(problem.positions.size() / problem.dimension, false);
  for (const std::int32_t node : problem.free) is_free[node] = true;
  std::unordered_map<Key, std::int32_t, KeyHash> numbers;
  numbers.reserve(static_cast<std::size_t>(problem.cells) * 2);
  for (const CellSet& cells : problem.sets) {
    const reference::ShapeInfo& shape = reference::info(cells.shape);
    const auto& places = reference::node_places(cells.shape, order);
    const std::vector<int> companions = fine_companions(cells.shape, order, cells.order);
    CoarseSpace::Set& set = space.sets.emplace_back();
    set.nodes_per_cell = static_cast<int>(places.size());
    set.stiffness = mean_stiffness(cells.shape, order, problem.dimension);
    set.values = values_at_nodes(cells, order);
    for (std::int32_t cell = 0; cell < cells.count; ++cell) {
      const std::int32_t* nodes = cells.nodes.data() + static_cast<std::size_t>(cell) * cells.nodes_per_cell;
      for (std::size_t a = 0; a < places.size(); ++a) {
        std::int32_t number = -1;
        if (is_free[nodes[companions[a]]])
          number = numbers.emplace(key_of(shape, places[a], nodes, cells.first + cell), space.count).first->second;
        if (number == space.count) ++space.count;
        set.nodes.push_back(number);
      }
    }
  }
  return space;
}

void renumber(CoarseSpace& space, const std::vector<std::int32_t>& number) {
  for (CoarseSpace::Set& set : space.sets)
    for (std::int32_t& node : set.nodes)
      if (node >= 0) node = number[node];
}

}  // namespace varimesh
