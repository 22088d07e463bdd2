// Matrices of a reference cell that multiply the values of several cells at a time, compiled for every vector unit.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace varimesh::detail {

/// Cells whose numbers lie beside each other: the lanes of all arrays here and of those that follow this layout,
/// [row][direction][lane].
inline constexpr std::size_t kCellLanes = 8;

/// A matrix, whole or as a product over the axes of a quadrilateral or hexahedron:
///
///     entry (r, c) = Π_a f(r_a, c_a),   r_a and c_a being the indices of row and column along axis a.
///
/// A product takes d steps with f in place of one with the whole matrix: at order 4 an eighth of the operations.
struct LaneMatrix {
  std::size_t rows = 0, columns = 0;
  std::vector<double> numbers;  ///< The matrix or f, row-major.
  std::size_t axes = 0;         ///< d; 0: `numbers` is the matrix itself.
  std::size_t factor_rows = 0, factor_columns = 0;
  /// By row and by column: Σ_a r_a n^a and Σ_a c_a m^a, f having the size n × m.
  std::vector<std::size_t> row_places, column_places;

  /// Numbers that a product needs room for: [place][direction][lane] before and after a step.
  std::size_t room(std::size_t directions) const;
};

LaneMatrix lane_matrix(const Eigen::MatrixXd& matrix);

/// A product over two or three axes. Rows and columns may leave out places.
LaneMatrix lane_matrix(const Eigen::MatrixXd& factor, std::size_t axes, std::vector<std::size_t> row_places,
                       std::vector<std::size_t> column_places);

/// out = matrix · in for each direction and lane. The result of a lane depends on the machine's vector unit only by its
/// fused multiplications, and not on the lanes beside it.
/// @param directions  2 or 3, and axes if that is not 0
/// @param in          [column][direction][lane]
/// @param out         [row][direction][lane]
/// @param room        grows to LaneMatrix::room()
void multiply_lanes(const LaneMatrix& matrix, std::size_t directions, const double* in, double* out,
                    std::vector<double>& room);

}  // namespace varimesh::detail
