// Bernstein coefficients of J in one cell, a number at a time: in double, as the batched kernel has them, and in wider
// arithmetic for where that drowns in rounding. How, and what they err by, is in certificate.h. Internal to
// core/quality.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/validity/bernstein.h"

namespace varimesh::detail {

/// A cell to certify, in the terms of the kernel.
struct HardCell {
  const JacobianTable* table = nullptr;
  const double* coordinates = nullptr;
  const std::int32_t* nodes = nullptr;
  double scale = 1;
  double sign = 1;
};

/// Bernstein coefficients of the scaled J, and what none of them errs by more than.
template <class Real>
struct Coefficients {
  std::vector<Real> values;
  Real error = 0;
};

/// In double.
Coefficients<double> plain_coefficients(const HardCell& cell);

/// Nodes converted in 113 bits, products in long double.
Coefficients<long double> extended_coefficients(const HardCell& cell);

/// Physical coordinates of the point with these barycentric coordinates (of all factors, one behind the other).
std::array<double, 3> physical_place(const HardCell& cell, const std::array<double, 6>& barycentric);

}  // namespace varimesh::detail
