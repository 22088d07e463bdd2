// Bernstein coefficients of J for as many cells at once as a vector has lanes. Internal to core/quality.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/validity/bernstein.h"

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
  /// All coefficients as computed, [coefficient][lane] with kernel_lanes() lanes: in the workspace, until the next
  /// call.
  const double* coefficients = nullptr;
};

/// Lanes of the vectors of the machine that this runs on.
std::size_t kernel_lanes();

/// Runs the kernel. `workspace` is room that the caller keeps from call to call.
void bernstein_kernel(const KernelInput& input, std::vector<double>& workspace, KernelOutput& output);

/// k u / (1 − k u): the relative error of k roundings one after another (N. J. Higham, Accuracy and Stability of
/// Numerical Algorithms, SIAM, 2002, section 3.1).
template <class Real>
constexpr Real rounding_error(int roundings, Real unit) {
  return Real(roundings) * unit / (1 - Real(roundings) * unit);
}

}  // namespace varimesh::detail
