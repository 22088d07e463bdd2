// What the parts of a cell's map are computed with, for one shape and order. Internal to the library.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/base/stop_token.h"
#include "core/reference/nodes.h"

namespace varimesh::detail {

/// The parts χ_s of a map and the integrals of products of their gradients. `d` is the dimension of the cell.
struct PartsTable {
  Eigen::MatrixXd mean_gradient;  ///< The mean of ∂(shape function n)/∂ξ_r over the reference cell: d × nodes.
  Eigen::MatrixXd to_modes;       ///< Nodal values to coefficients of the modes above degree 1, sorted by their degree.
  std::vector<int> modes;         ///< By row of to_modes: the number of the mode (core/reference/modal.h).
  std::vector<Eigen::Index> first;  ///< The modes of degree s are first[s − 2] to first[s − 1] − 1.
  /// (1/|Ê|) ∫ (∂_a φ_m ∂_b φ_n + ∂_b φ_m ∂_a φ_n) / 2 for the modes m, n of degree s: [s − 2][pair of a ≤ b], the
  /// pairs in the order 00, 01, 02, 11, 12, 22, without those of a third direction in 2-D.
  std::vector<std::vector<Eigen::MatrixXd>> products;
};

/// The table of a shape and order, on the equispaced nodes of a mesh's file or on the optimised ones. It is made once
/// and kept until the program ends.
/// @param stop  may throw Interrupted while the table is made, which takes up to a second; null: never
const PartsTable& parts_table(Shape shape, int order, reference::NodeSet set = reference::NodeSet::Equispaced,
                              const StopToken* stop = nullptr);

}  // namespace varimesh::detail
