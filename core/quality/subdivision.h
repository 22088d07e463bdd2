// One cell at a time: its coefficients, cut in two until the answer is clear. Internal to core/quality.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/quality/bernstein.h"
#include "core/quality/certificate.h"

namespace varimesh::detail {

/// A cell to certify, in the terms of the kernel.
struct HardCell {
  const JacobianTable* table = nullptr;
  const double* coordinates = nullptr;
  const std::int32_t* nodes = nullptr;
  double scale = 1;
  double sign = 1;
};

/// Certifies by subdivision, in double and where that cannot tell in wider arithmetic.
Certificate subdivide(const HardCell& cell, const CertificateOptions& options);

/// The same where the Bernstein coefficients of the scaled J are known already, none further from the exact one than
/// `error`.
Certificate subdivide(const HardCell& cell, const CertificateOptions& options, std::vector<double> coefficients,
                      double error);

/// Whether rounding blunts the lower bound of a valid cell, so that wider arithmetic gives a better one.
template <class Real>
bool is_blunt(Real error, Real lower) {
  return error > Real(1e-3) * lower;
}

/// Bernstein coefficients of J in extended precision, and what none of them errs by more than: what tests hold the
/// kernel against.
struct ExtendedCoefficients {
  std::vector<long double> values;
  long double error = 0;
};
ExtendedCoefficients extended_coefficients(const HardCell& cell);

/// Fills in a certificate's bounds from those of the scaled J: J in [lower, upper], max J at least `greatest`.
void set_bounds(const HardCell& cell, double lower, double upper, double greatest, Certificate& certificate);

/// Physical coordinates of the point with these barycentric coordinates (of all factors, one behind the other).
std::array<double, 3> physical_place(const HardCell& cell, const std::array<double, 6>& barycentric);

}  // namespace varimesh::detail
