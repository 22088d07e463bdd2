// How much memory the runs on a geometry need.
#include <algorithm>

#include "core/mesh/mesh_counts.h"
#include "core/optimise/memory.h"
#include "core/optimise/on_geometry/optimise_on_geometry.h"
#include "core/repair/boundary/cusps.h"

namespace varimesh {

std::int64_t memory_needed_on_geometry(const HighOrderMesh& mesh, const Options& options,
                                       const GeometryOptions& geometry) {
  Options of_curved = options;
  if (geometry.order > 0) of_curved.order = geometry.order;
  // Beside the run there are the mesh as it came and the best result so far.
  const MeshCounts counts = count(mesh, of_curved.order > 0 ? of_curved.order : mesh.order);
  // Cusps are looked for after the run.
  const std::int64_t cusps = mesh.dimension == 3 ? bytes_of_cusps(counts) : 0;
  return std::max(memory_needed(mesh, of_curved), cusps + bytes_of_mesh(counts)) + 2 * bytes_of_mesh(counts);
}

}  // namespace varimesh
