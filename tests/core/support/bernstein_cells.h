// Polynomials in Bernstein form, evaluated the plain way, and cells as the certificates' coefficients take them.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <vector>

#include "core/validity/bernstein.h"
#include "core/validity/cell_coefficients.h"
#include "tests/core/support/made_cells.h"

namespace varimesh::detail {

/// Barycentric coordinates (factor behind factor) of a point of the reference cell.
inline std::array<double, 6> barycentric(Shape shape, const Eigen::RowVectorXd& xi) {
  const auto half = [&](Eigen::Index c) { return (1 + xi(c)) / 2; };
  switch (shape) {
    case Shape::Triangle:
      return {1 - half(0) - half(1), half(0), half(1)};
    case Shape::Tetrahedron:
      return {1 - half(0) - half(1) - half(2), half(0), half(1), half(2)};
    case Shape::Prism:
      return {1 - half(0) - half(1), half(0), half(1), 1 - half(2), half(2)};
    case Shape::Pyramid: {
      const double s = 1 - half(2), u = (1 + xi(0) / s) / 2, v = (1 + xi(1) / s) / 2;
      return {1 - u, u, 1 - v, v, s, 1 - s};
    }
    case Shape::Quadrilateral:
      return {1 - half(0), half(0), 1 - half(1), half(1)};
    default:
      return {1 - half(0), half(0), 1 - half(1), half(1), 1 - half(2), half(2)};
  }
}

inline double evaluate(const BernsteinSpace& space, const std::vector<long double>& coefficients,
                       const std::array<double, 6>& at) {
  long double sum = 0;
  for (int k = 0; k < space.size(); ++k) {
    long double term = coefficients[static_cast<std::size_t>(k)] * space.multinomial(k);
    for (std::size_t slot = 0; slot < 6; ++slot)
      term *= std::pow(static_cast<long double>(at[slot]), space.exponents()[static_cast<std::size_t>(k)][slot]);
    sum += term;
  }
  return static_cast<double>(sum);
}

/// Cell number `cell` of a mesh with one block.
inline CellToCertify hard_cell(const HighOrderMesh& mesh, std::size_t cell) {
  const ElementBlock& block = mesh.blocks[0];
  const JacobianTable& table = jacobian_table(block.shape, block.order);
  return {&table, mesh.coordinates.data(), block.nodes.data() + cell * static_cast<std::size_t>(table.nodes), 1, 1};
}

}  // namespace varimesh::detail
