// Certifies one cell by cutting it in two until the answer is clear. Internal to the library.
#pragma once

#include "core/validity/cell_coefficients.h"
#include "core/validity/certificate.h"

namespace varimesh::detail {

/// Certifies a cell by subdivision: in double, and in wider arithmetic if double cannot tell.
Certificate subdivide(const CellToCertify& cell, const CertificateOptions& options);

/// The same for a cell whose coefficients are known already.
Certificate subdivide(const CellToCertify& cell, const CertificateOptions& options, Coefficients<double> coefficients);

/// Whether rounding weakens the lower bound of a valid cell so much that wider arithmetic gives a better one.
template <class Real>
bool is_blunt(Real error, Real lower) {
  return error > Real(1e-3) * lower;
}

/// Fills in a certificate's bounds from those of the scaled J: J lies in [lower, upper], and max J is at least
/// `greatest`.
void set_bounds(const CellToCertify& cell, double lower, double upper, double greatest, Certificate& certificate);

}  // namespace varimesh::detail
