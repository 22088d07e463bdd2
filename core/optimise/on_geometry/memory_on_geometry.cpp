// How much memory the runs on a geometry need.
#include "core/mesh/mesh_counts.h"
#include "core/optimise/memory.h"
#include "core/optimise/on_geometry/optimise_on_geometry.h"

namespace varimesh {

std::int64_t memory_needed_on_geometry(const HighOrderMesh& mesh, const Options& options,
                                       const GeometryOptions& geometry) {
  Options of_curved = options;
  if (geometry.order > 0) of_curved.order = geometry.order;
  // Beside the run there are the mesh as it came and the best result so far.
  const MeshCounts counts = count(mesh, of_curved.order > 0 ? of_curved.order : mesh.order);
  return memory_needed(mesh, of_curved) + 2 * bytes_of_mesh(counts);
}

}  // namespace varimesh
