// det ∇χ_M on a lattice of points, for as many cells at once as a vector has lanes. Internal to the library.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/mesh/high_order_mesh.h"
#include "core/reference/nodes.h"

namespace varimesh::detail {

inline constexpr std::size_t kMostLatticeLanes = 32;

/// The lattice of one shape and order.
struct LatticeTable {
  int dimension = 0;
  int nodes = 0;     ///< Nodes of the cell.
  int vertices = 0;  ///< Vertices of the straight-sided cell, its first nodes; 0 if its J is constant.
  reference::Points points;
  std::vector<double> gradients;  ///< ∂(shape function n)/∂ξ_r at point p: [p][n][r].
  std::vector<double> straight;   ///< The same for the vertices' functions of order 1.
};

LatticeTable lattice_table(Shape shape, int order, int intervals, int dimension);

/// Extremes in one cell. Their signs follow the mesh's numbering.
struct Extremes {
  double low = 0, high = 0, mean = 0;    ///< Values of J.
  std::int32_t low_at = 0, high_at = 0;  ///< Numbers of lattice points.
  /// Values of det ∇χ_M / det ∇χ_L; −1 if the straight-sided cell is itself inverted somewhere, 0 if its J is constant.
  double distortion_low = 0, distortion_high = 0;
};

/// Lanes of the vectors of the machine that this runs on.
std::size_t lattice_lanes();

/// Samples `cells` ≤ lattice_lanes() cells, given by their node lists. `coordinates`: x y z of every node of the mesh,
/// interleaved. `workspace` is memory that the caller keeps from call to call.
void sample_on_lattice(const LatticeTable& table, const double* coordinates, const std::int32_t* const* nodes,
                       std::size_t cells, std::vector<double>& workspace, Extremes* out);

}  // namespace varimesh::detail
