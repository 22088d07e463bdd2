// Bernstein coefficients of J in one cell, one number at a time: in double, like the batched kernel, and in wider
// arithmetic for cells whose answer is lost in rounding. Internal to the library. certifier.h has the method, and
// rounding_bound-inl.h the bound on its errors.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/stop_token.h"
#include "core/validity/bernstein.h"

namespace varimesh::detail {

/// One cell to certify, as the kernel has it.
struct CellToCertify {
  const JacobianTable* table = nullptr;
  const double* coordinates = nullptr;  ///< x y z of every node of the mesh.
  const std::int32_t* nodes = nullptr;  ///< The cell's node indices, in Gmsh's order.
  double scale = 1;                     ///< A power of two that brings the mesh to a size of about one.
  double sign = 1;                      ///< −1 if the mesh is numbered clockwise.
};

/// Bernstein coefficients of the scaled J, and a bound on the error of each of them.
template <class Real>
struct Coefficients {
  std::vector<Real> values;
  Real error = 0;
};

/// In double.
Coefficients<double> plain_coefficients(const CellToCertify& cell);

/// Nodes converted in 113 bits, products in long double. Looks at the token, which may be null: a hexahedron of order
/// 10 takes half a second.
Coefficients<long double> extended_coefficients(const CellToCertify& cell, const StopToken* stop = nullptr);

/// Physical coordinates of the point with these barycentric coordinates (of all factors, one after the other). They are
/// three in 2-D too.
std::array<double, 3> physical_place(const CellToCertify& cell, const std::array<double, 6>& barycentric);

}  // namespace varimesh::detail
