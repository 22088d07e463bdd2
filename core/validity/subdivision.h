// Certifies one cell by cutting it in two until the answer is clear. Internal to the library.
#pragma once

#include "core/base/stop_token.h"
#include "core/validity/cell_coefficients.h"
#include "core/validity/certificate.h"

namespace varimesh::detail {

/// Certifies a cell by subdivision: in double, and in wider arithmetic if double cannot tell. Looks at the token, which
/// may be null: one cell of a high order may take seconds.
Certificate subdivide(const CellToCertify& cell, const CertificateOptions& options, const StopToken* stop = nullptr);

/// The same for a cell whose coefficients are known already.
Certificate subdivide(const CellToCertify& cell, const CertificateOptions& options, Coefficients<double> coefficients,
                      const StopToken* stop = nullptr);

/// Whether rounding weakens the lower bound of a valid cell so much that wider arithmetic gives a better one.
template <class Real>
bool is_blunt(Real error, Real lower) {
  return error > Real(1e-3) * lower;
}

/// Fills in a certificate's bounds from those of the scaled J: J lies in [lower, upper], and max J is at least
/// `greatest`.
void set_bounds(const CellToCertify& cell, double lower, double upper, double greatest, Certificate& certificate);

}  // namespace varimesh::detail
