// Bernstein coefficients of J for as many cells at once as a vector has lanes. Internal to the library.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/validity/bernstein.h"

namespace varimesh::detail {

inline constexpr std::size_t kMostLanes = 32;

/// The cells of one call, at most kernel_lanes(). All have the same table.
struct KernelInput {
  const JacobianTable* table = nullptr;
  const double* coordinates = nullptr;                  ///< x y z of every node of the mesh.
  double scale = 1;                                     ///< A power of two that brings the mesh to a size of about one.
  double sign = 1;                                      ///< −1 if the mesh is numbered clockwise.
  std::array<const std::int32_t*, kMostLanes> nodes{};  ///< By cell: its node indices, in Gmsh's order.
  std::size_t cells = 0;
};

/// What the coefficients say, one lane per cell, in units of scale^dimension.
struct KernelOutput {
  std::array<double, kMostLanes> least{}, greatest{};      ///< Smallest and largest coefficient as computed.
  std::array<double, kMostLanes> error{};                  ///< No coefficient is further from the exact one.
  std::array<std::array<double, kMostLanes>, 8> corner{};  ///< J at the table's corners, as computed.
  /// All coefficients as computed, [coefficient][lane] with kernel_lanes() lanes. They lie in the workspace and are
  /// valid until the next call.
  const double* coefficients = nullptr;
};

/// Lanes of the vectors of the machine that this runs on.
std::size_t kernel_lanes();

/// Runs the kernel. `workspace` is memory that the caller keeps from call to call.
void bernstein_kernel(const KernelInput& input, std::vector<double>& workspace, KernelOutput& output);

}  // namespace varimesh::detail
