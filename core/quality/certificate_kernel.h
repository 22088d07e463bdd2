// Bernstein coefficients of J for as many cells at once as a vector has lanes. Internal to core/quality.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/quality/bernstein.h"

namespace varimesh::detail {

inline constexpr std::size_t kMostLanes = 32;

/// Cells to look at: all of one table; node lists of up to kernel_lanes() cells.
struct KernelInput {
  const JacobianTable* table = nullptr;
  const double* coordinates = nullptr;  ///< x y z of every node
  double scale = 1;                     ///< A power of two that brings the mesh to a size of about one.
  double sign = 1;                      ///< −1 where the mesh is numbered clockwise.
  std::array<const std::int32_t*, kMostLanes> nodes{};
  std::size_t cells = 0;
};

/// What the coefficients say, a lane each, in units of scale^dimension.
struct KernelOutput {
  std::array<double, kMostLanes> least{}, greatest{};      ///< Smallest and largest coefficient as computed.
  std::array<double, kMostLanes> error{};                  ///< No coefficient is further from the exact one.
  std::array<std::array<double, kMostLanes>, 8> corner{};  ///< J at the table's corners, as computed.
  /// All coefficients as computed, [coefficient][lane] with kernel_lanes() lanes: in the workspace, until the next call.
  const double* coefficients = nullptr;
};

/// Lanes of the vectors of the machine that this runs on.
std::size_t kernel_lanes();

/// Runs the kernel. `workspace` is room that the caller keeps from call to call.
void bernstein_kernel(const KernelInput& input, std::vector<double>& workspace, KernelOutput& output);

/// Bound on the error of every Bernstein coefficient of J, from the largest computed control points of the derivatives,
/// size[r][c] = max_α |g_r,α,c|, and bounds on their errors. The derivation is in certificate.h.
template <class Real>
Real coefficient_error(int dimension, const std::array<std::array<Real, 3>, 3>& size,
                       const std::array<std::array<Real, 3>, 3>& error, Real product_error) {
  std::array<std::array<Real, 3>, 3> most;
  for (int r = 0; r < dimension; ++r)
    for (int c = 0; c < dimension; ++c) most[r][c] = size[r][c] * Real(1.0001) + error[r][c];
  const auto permanent = [dimension](const auto& a, const auto& b, const auto& c) {
    if (dimension == 2) return a[0] * b[1] + a[1] * b[0];
    return a[0] * (b[1] * c[2] + b[2] * c[1]) + a[1] * (b[0] * c[2] + b[2] * c[0]) + a[2] * (b[0] * c[1] + b[1] * c[0]);
  };
  Real sum = product_error * permanent(most[0], most[1], most[2]) + permanent(error[0], most[1], most[2]) +
             permanent(most[0], error[1], most[2]);
  if (dimension == 3) sum += permanent(most[0], most[1], error[2]);
  // The derivatives are with respect to barycentric coordinates, half those to reference coordinates, squared or cubed.
  // Rounding in this bound itself is covered by the last factor, underflow by the last term: coordinates are of size
  // one.
  return sum * Real(dimension == 2 ? 0.25 : 0.125) * Real(1.000001) + Real(1e-290);
}

/// k u / (1 − k u): the relative error of k roundings one after another (N. J. Higham, Accuracy and Stability of
/// Numerical Algorithms, SIAM, 2002, section 3.1).
template <class Real>
constexpr Real rounding_error(int roundings, Real unit) {
  return Real(roundings) * unit / (1 - Real(roundings) * unit);
}

}  // namespace varimesh::detail
