#include "core/device_kernels/split_tables.h"

#include <algorithm>
#include <array>

#include "core/base/index.h"
#include "core/reference/basis.h"
#include "core/reference/nodes.h"
#include "core/reference/quadrature.h"

namespace varimesh::device {
namespace {

using reference::NodeSet;
using reference::Points;

/// The base of a shape that is a base times a line.
Shape base_of(Shape shape) {
  switch (shape) {
    case Shape::Quadrilateral:
      return Shape::Line;
    case Shape::Prism:
      return Shape::Triangle;
    default:
      return Shape::Quadrilateral;
  }
}

/// The points of a rule that is a rule on the base times one on the line, in whose order the line comes last.
struct Factors {
  Points bases, heights;
};
std::optional<Factors> factors_of(const Points& points) {
  const Eigen::Index base = points.cols() - 1;
  Eigen::Index heights = 1;
  while (heights < points.rows() && points.row(heights).head(base) == points.row(0).head(base)) ++heights;
  if (points.rows() % heights != 0) return std::nullopt;
  Factors factors{Points(points.rows() / heights, base), points.block(0, base, heights, 1)};
  for (Eigen::Index row = 0; row < points.rows(); ++row) {
    if (row % heights == 0) factors.bases.row(row / heights) = points.row(row).head(base);
    if (points.row(row).head(base) != factors.bases.row(row / heights) ||
        points(row, base) != factors.heights(row % heights, 0))
      return std::nullopt;
  }
  return factors;
}

/// The local number of each node, by column and layer.
std::vector<std::int32_t> nodes_by_column(Shape shape, Shape base, int order) {
  const auto& of_cell = reference::lattice(shape, order);
  const auto& of_base = reference::lattice(base, order);
  const auto& of_line = reference::lattice(Shape::Line, order);
  const std::size_t along = base == Shape::Line ? 1 : 2;
  std::vector<std::int32_t> nodes;
  for (const auto& column : of_base)
    for (const auto& layer : of_line) {
      std::array<std::int8_t, 3> wanted = column;
      wanted[along] = layer[0];
      nodes.push_back(static_cast<std::int32_t>(std::ranges::find(of_cell, wanted) - of_cell.begin()));
    }
  return nodes;
}

SplitTables of_simplex(const CellSet& set, CellKind kind, const std::vector<int>& slots) {
  SplitTables tables;
  tables.kind = kind;
  tables.bases = set.points;
  for (const int point : slots)
    for (int k = 0; k < set.dimension; ++k)
      for (int n = 0; n < set.nodes_per_cell; ++n) tables.base.push_back(set.derivatives_of(n)[k * set.stride + point]);
  return tables;
}

}  // namespace

std::optional<SplitTables> split_tables(const CellSet& set, CellKind kind, const std::vector<int>& slots) {
  if (!kind.is_layered()) return of_simplex(set, kind, slots);
  const Points points = reference::quadrature(set.shape, set.order, set.degree).points;
  const auto factors = factors_of(points);
  if (points.rows() != set.points || !factors) return std::nullopt;
  const Shape base = base_of(set.shape);
  SplitTables tables;
  tables.kind = kind;
  tables.bases = static_cast<int>(factors->bases.rows());
  tables.heights = static_cast<int>(factors->heights.rows());
  tables.nodes = nodes_by_column(set.shape, base, set.order);
  const auto values = reference::basis_values(base, set.order, NodeSet::Optimised, set.dimension, factors->bases);
  const auto slopes = reference::basis_gradients(base, set.order, NodeSet::Optimised, set.dimension, factors->bases);
  for (Eigen::Index point = 0; point < values.rows(); ++point)
    for (int k = 0; k < set.dimension; ++k)
      for (Eigen::Index column = 0; column < values.cols(); ++column)
        tables.base.push_back(k + 1 < set.dimension ? slopes[at(k)](point, column) : values(point, column));
  const auto along =
      reference::basis_values(Shape::Line, set.order, NodeSet::Optimised, set.dimension, factors->heights);
  const auto slopes_along =
      reference::basis_gradients(Shape::Line, set.order, NodeSet::Optimised, set.dimension, factors->heights);
  for (Eigen::Index point = 0; point < along.rows(); ++point)
    for (Eigen::Index layer = 0; layer < along.cols(); ++layer) {
      tables.line.push_back(along(point, layer));
      tables.line.push_back(slopes_along[0](point, layer));
    }
  tables.slots.resize(at(set.points));
  for (std::size_t slot = 0; slot < slots.size(); ++slot)
    tables.slots[at(slots[slot] % tables.heights * tables.bases + slots[slot] / tables.heights)] =
        static_cast<std::int32_t>(slot);
  return tables;
}

template <class T>
std::vector<T> SplitTables::derivatives(int parts) const {
  const int per_part = columns_of_part(kind, parts), d = kind.dimension;
  std::vector<T> table;
  for (int point = 0; point < padded_points(bases, parts); ++point)
    for (int part = 0; part < parts; ++part)
      for (int k = 0; k < d; ++k)
        for (int column = part * per_part; column < (part + 1) * per_part; ++column)
          table.push_back(point < bases && column < kind.columns
                              ? static_cast<T>(base[at((point * d + k) * kind.columns + column)])
                              : T(0));
  for (const double number : line) table.push_back(static_cast<T>(number));
  return table;
}

template std::vector<float> SplitTables::derivatives(int parts) const;
template std::vector<double> SplitTables::derivatives(int parts) const;

}  // namespace varimesh::device
