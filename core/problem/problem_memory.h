// The bytes of a problem, for the estimate of a run's memory.
#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/mesh_counts.h"

namespace varimesh {

/// The sizes of one CellSet.
struct SetSizes {
  Shape shape = Shape::Triangle;
  int dimension = 0, order = 0;
  std::int64_t nodes = 0;   ///< Per cell.
  std::int64_t points = 0;  ///< Of the quadrature rule.
  std::int64_t stride = 0;  ///< The same, padded.
  bool affine = false;
  std::int64_t count = 0;  ///< Cells.
};

/// The sets of build_problem() for a mesh with these counts.
std::vector<SetSizes> set_sizes(const MeshCounts& counts, int quadrature_degree);

/// What Problem keeps, with targets but without deformation gradients. `has_left_factor`: as CellSet::left_factor.
std::int64_t bytes_of_problem(const MeshCounts& counts, const std::vector<SetSizes>& sets, bool has_left_factor);

/// The most that build_problem() has in use beside its result: tables that it makes others from, and lists of cells.
std::int64_t bytes_of_building(const MeshCounts& counts, const std::vector<SetSizes>& sets);

/// What hold_deformation() allocates.
std::int64_t bytes_of_deformation(const std::vector<SetSizes>& sets, bool keeps_function);

/// What NodeConversion keeps, and the tables of reference::conversion() that it takes.
std::int64_t bytes_of_conversion(const MeshCounts& counts);

}  // namespace varimesh
