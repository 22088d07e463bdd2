// Between the spaces of neighbouring orders on one shape, from nodes to modes, and squares of basis functions. Nodes
// are the optimised ones. Internal to the library.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/kernels/dense/lane_matrix.h"
#include "core/reference/shape.h"

namespace varimesh::detail {

/// A matrix and its transpose. On quadrilaterals and hexahedra both are products over the axes.
struct LanePair {
  LaneMatrix there, back;
};

/// Values at the nodes of order `order` + 1 from those of `order`, and back.
LanePair raising(Shape shape, int order);

/// Values at the nodes to PartsTable::to_modes, and back.
LanePair to_modes(Shape shape, int order);

/// For cells of order P and all lower orders.
struct OrderTables {
  /// Integrals for each basis function of one order; the pairs of directions are those of PartsTable::products.
  struct Squares {
    std::vector<std::vector<Eigen::VectorXd>> of_parts;  ///< [s − 2][pair]: of the parts of degree s ≤ the order.
    std::vector<Eigen::VectorXd> of_gradient;  ///< [pair]: the mean of ∂_a φ ∂_b φ over the reference cell.
  };
  std::vector<LanePair> raise;   ///< [q − 1]: raising(q), q < P.
  std::vector<Squares> squares;  ///< [q − 1], q = 1 … P.
};

/// The tables of a shape and order. They are made once and kept until the program ends.
const OrderTables& order_tables(Shape shape, int order);

}  // namespace varimesh::detail
