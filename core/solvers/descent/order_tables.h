// Between the spaces of neighbouring orders on one shape, and squares of their basis functions. Internal to the
// library.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/reference/shape.h"

namespace varimesh::detail {

/// For cells of order P and all lower orders. Nodes are the optimised ones.
struct OrderTables {
  /// Integrals for each basis function of one order; the pairs of directions are those of PartsTable::products.
  struct Squares {
    std::vector<std::vector<Eigen::VectorXd>> of_parts;  ///< [s − 2][pair]: of the parts of degree s ≤ the order.
    std::vector<Eigen::VectorXd> of_gradient;  ///< [pair]: the mean of ∂_a φ ∂_b φ over the reference cell.
  };
  std::vector<Eigen::MatrixXd> raise;  ///< [q − 1]: values at the nodes of order q + 1 from those of order q < P.
  std::vector<Squares> squares;        ///< [q − 1], q = 1 … P.
};

/// The tables of a shape and order. They are made once and kept until the program ends.
const OrderTables& order_tables(Shape shape, int order);

}  // namespace varimesh::detail
