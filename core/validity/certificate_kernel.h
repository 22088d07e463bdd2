// Bernstein coefficients of J for as many cells at once as a vector has lanes. Internal to the library.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
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

/// Cells that are measured elsewhere stand in batches of this many.
inline constexpr std::size_t kMeasuredTogether = 16;

/// How many numbers measure a cell of this table. With d the dimension, they are: the largest control points of the d
/// derivatives, [derivative][component]; the largest absolute coordinates relative to the first node, [component]; NaN
/// if a coordinate is not finite, else 0; the smallest and the largest coefficient of J; J at the table's corners.
inline std::size_t measures_of(const JacobianTable& table) {
  const auto d = static_cast<std::size_t>(table.dimension);
  return d * d + d + 3 + table.corners.size();
}

/// The output of the kernel, but for the coefficients, which are null, for cells that were measured elsewhere. The
/// bound on the error is computed here, as the kernel does.
/// @param measures  number i of cell k is measures[i * stride + k]
/// @param cells     at most kernel_lanes()
void judge_measures(const JacobianTable& table, const double* measures, std::size_t stride, std::size_t cells,
                    KernelOutput& output);

/// The cells that are measured in one call. All have the same table.
struct MeasureInput {
  const JacobianTable* table = nullptr;
  double scale = 1, sign = 1;                  ///< As in KernelInput.
  std::span<const std::int32_t* const> nodes;  ///< By cell: its node indices, in Gmsh's order.
};

/// Measures cells elsewhere than on the processor. If a function returns false, it cannot, and the processor has to.
class MeasuresElsewhere {
 public:
  virtual ~MeasuresElsewhere() = default;
  /// Takes the coordinates (x y z of each node of the mesh) for the calls of measure() that follow, until forget().
  virtual bool take(std::span<const double> coordinates) = 0;
  /// `measures` becomes batches × number × cell of the batch.
  virtual bool measure(const MeasureInput& input, std::vector<double>& measures) = 0;
  virtual void forget() = 0;
};

}  // namespace varimesh::detail
