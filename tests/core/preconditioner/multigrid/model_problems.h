// Stiffness matrices of −∇·(κ∇u) in linear functions on structured grids, to try multigrid on.
#pragma once

#include <Eigen/Dense>
#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <random>
#include <vector>

#include "core/base/index.h"
#include "core/preconditioner/multigrid/sparse_rows.h"

namespace varimesh::testing {

/// A matrix with its own arrays.
struct TestMatrix {
  std::vector<std::int64_t> row_begin{0};
  std::vector<std::int32_t> column;
  std::vector<double> value;

  std::int32_t rows() const { return static_cast<std::int32_t>(row_begin.size()) - 1; }
  CompressedRows view() const { return {rows(), row_begin.data(), column.data(), value.data()}; }
};

using RowMajor = Eigen::SparseMatrix<double, Eigen::RowMajor>;

inline TestMatrix to_test_matrix(const RowMajor& matrix) {
  TestMatrix out;
  for (int row = 0; row < matrix.rows(); ++row) {
    for (RowMajor::InnerIterator entry(matrix, row); entry; ++entry) {
      out.column.push_back(entry.col());
      out.value.push_back(entry.value());
    }
    out.row_begin.push_back(static_cast<std::int64_t>(out.column.size()));
  }
  return out;
}

inline RowMajor to_eigen(const TestMatrix& matrix) {
  std::vector<Eigen::Triplet<double>> entries;
  for (std::int32_t row = 0; row < matrix.rows(); ++row)
    for (std::int64_t e = matrix.row_begin[at(row)]; e < matrix.row_begin[at(row) + 1]; ++e)
      entries.emplace_back(row, matrix.column[at(e)], matrix.value[at(e)]);
  RowMajor out(matrix.rows(), matrix.rows());
  out.setFromTriplets(entries.begin(), entries.end());
  return out;
}

/// A grid of boxes; the vertices on its boundary are fixed.
struct ModelProblem {
  std::vector<std::vector<double>> steps;  ///< Of each direction, two or three: the sizes of the cells.
  bool is_simplicial = false;              ///< Boxes are cut into triangles or tetrahedra.
  /// κ in the cell with these indices; the third is 0 in two dimensions.
  std::function<double(const std::array<int, 3>&)> coefficient = [](const std::array<int, 3>&) { return 1.0; };
};

inline std::vector<double> equal_steps(int free_vertices, double size) {
  return std::vector<double>(at(free_vertices) + 1, size);
}

/// Grows by a factor from step to step, up to 1.
inline std::vector<double> boundary_layer(int free_vertices, double first, double growth) {
  std::vector<double> steps{first};
  while (steps.size() < at(free_vertices) + 1) steps.push_back(std::min(1.0, steps.back() * growth));
  return steps;
}

using ElementMatrix = Eigen::Matrix<double, 8, 8>;

/// ∫ ∇φ_p · ∇φ_q over a box, φ multilinear. Bit i of a corner's number says whether it is at the end of side i.
inline ElementMatrix box_matrix(const std::vector<double>& sides) {
  ElementMatrix out = ElementMatrix::Zero();
  const int d = static_cast<int>(sides.size());
  for (int p = 0; p < 1 << d; ++p)
    for (int q = 0; q < 1 << d; ++q)
      for (int along = 0; along < d; ++along) {
        double product = 1;
        for (int i = 0; i < d; ++i) {
          const bool is_same = ((p ^ q) >> i & 1) == 0;
          product *= i == along ? (is_same ? 1 : -1) / sides[at(i)] : sides[at(i)] * (is_same ? 2 : 1) / 6;
        }
        out(p, q) += product;
      }
  return out;
}

/// The same for linear functions on the d! simplices of Kuhn's cut, each of which has a path along d edges of the box.
inline ElementMatrix simplex_matrix(const std::vector<double>& sides) {
  ElementMatrix out = ElementMatrix::Zero();
  const int d = static_cast<int>(sides.size());
  double volume = 1;
  for (int i = 0; i < d; ++i) volume *= sides[at(i)] / (i + 1);
  std::vector<int> order(at(d));
  for (int i = 0; i < d; ++i) order[at(i)] = i;
  do {
    std::vector<int> path{0};
    for (const int i : order) path.push_back(path.back() | 1 << i);
    // The function of vertex s falls along the edge after it and rises along the edge before it.
    const auto gradient = [&](int s) {
      Eigen::Vector3d g = Eigen::Vector3d::Zero();
      if (s > 0) g[order[at(s - 1)]] += 1 / sides[at(order[at(s - 1)])];
      if (s < d) g[order[at(s)]] -= 1 / sides[at(order[at(s)])];
      return g;
    };
    for (int s = 0; s <= d; ++s)
      for (int t = 0; t <= d; ++t) out(path[at(s)], path[at(t)]) += volume * gradient(s).dot(gradient(t));
  } while (std::next_permutation(order.begin(), order.end()));
  return out;
}

inline TestMatrix stiffness(const ModelProblem& problem) {
  const int d = static_cast<int>(problem.steps.size());
  std::array<int, 3> cells{1, 1, 1};
  for (int i = 0; i < d; ++i) cells[at(i)] = static_cast<int>(problem.steps[at(i)].size());
  const auto vertex = [&](const std::array<int, 3>& cell, int corner) {
    int number = 0;
    for (int i = d; i-- > 0;) {
      const int place = cell[at(i)] + (corner >> i & 1) - 1;
      if (place < 0 || place >= cells[at(i)] - 1) return -1;
      number = number * (cells[at(i)] - 1) + place;
    }
    return number;
  };
  std::vector<Eigen::Triplet<double>> entries;
  std::array<int, 3> cell{};
  for (cell[2] = 0; cell[2] < cells[2]; ++cell[2])
    for (cell[1] = 0; cell[1] < cells[1]; ++cell[1])
      for (cell[0] = 0; cell[0] < cells[0]; ++cell[0]) {
        std::vector<double> sides;
        for (int i = 0; i < d; ++i) sides.push_back(problem.steps[at(i)][at(cell[at(i)])]);
        const ElementMatrix K =
            problem.coefficient(cell) * (problem.is_simplicial ? simplex_matrix(sides) : box_matrix(sides));
        for (int p = 0; p < 1 << d; ++p)
          for (int q = 0; q < 1 << d; ++q)
            if (const int row = vertex(cell, p), column = vertex(cell, q); row >= 0 && column >= 0 && K(p, q) != 0)
              entries.emplace_back(row, column, K(p, q));
      }
  int rows = 1;
  for (int i = 0; i < d; ++i) rows *= cells[at(i)] - 1;
  RowMajor matrix(rows, rows);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return to_test_matrix(matrix);
}

/// Numbers between −1 and 1.
inline std::vector<double> random_numbers(std::size_t count) {
  std::mt19937 random(1);
  std::vector<double> out(count);
  for (double& value : out) value = static_cast<double>(random()) / 2147483648.0 - 1;
  return out;
}

}  // namespace varimesh::testing
