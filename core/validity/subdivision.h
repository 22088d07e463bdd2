// One cell at a time, cut in two until the answer is clear. Internal to core/quality.
#pragma once

#include "core/validity/cell_coefficients.h"
#include "core/validity/certificate.h"

namespace varimesh::detail {

/// Certifies by subdivision, in double and where that cannot tell in wider arithmetic.
Certificate subdivide(const HardCell& cell, const CertificateOptions& options);

/// The same where the coefficients are known already.
Certificate subdivide(const HardCell& cell, const CertificateOptions& options, Coefficients<double> coefficients);

/// Whether rounding blunts the lower bound of a valid cell, so that wider arithmetic gives a better one.
template <class Real>
bool is_blunt(Real error, Real lower) {
  return error > Real(1e-3) * lower;
}

/// Fills in a certificate's bounds from those of the scaled J: J in [lower, upper], max J at least `greatest`.
void set_bounds(const HardCell& cell, double lower, double upper, double greatest, Certificate& certificate);

}  // namespace varimesh::detail
