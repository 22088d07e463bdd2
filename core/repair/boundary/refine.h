// Splits edges on the boundary, with new nodes on the geometry.
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "core/association/association.h"
#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"
#include "core/repair/repair_step.h"

namespace varimesh {

/// What is to be refined, and how far.
struct RefineRequest {
  std::span<const std::int64_t> wanted;  ///< Numbers of cells, in ascending order.
  std::size_t most_cells = 0;            ///< No edge is split if the mesh had more cells then.
  std::vector<bool> held;                ///< By node: edges with such a node between their ends are not split.
};

/// What refine() has done.
struct RefineReport {
  std::size_t edges = 0;           ///< How many were split; if it is 0, nothing has changed.
  bool is_full = false;            ///< Another edge would have been split, but the mesh may not grow so far.
  std::set<std::string> surfaces;  ///< At which surfaces of the geometry, as Surface::number_text().
};

/// Splits one edge of each wanted cell, as far as no two of the edges share a cell, together with all cells around it
/// (split.h). So the mesh conforms. If two edges of a boundary face lie on curves and leave no room between them,
/// because they meet at about 180°, the edge opposite is the candidate. Otherwise, of the edges of a cell on the
/// boundary, those are candidates along which the surfaces and curves of the geometry turn most; if they hardly turn,
/// the longest one is. The edge that the most wanted cells share per cell that is added comes first. If no wanted cell
/// has an edge on the boundary that may be split, the longest edges of the wanted cells are candidates. An edge at
/// which two sides of the boundary touch (boundary/pinched_edges.h) gets a new vertex for each side.
///
/// New vertices lie on the geometry, in the middle of their edge, and other new boundary nodes between them
/// (core/curve/refined.h).
///
/// An edge is not split if it is not sure where it belongs, if it lies on a periodic boundary or has held nodes, or if
/// a cell around it is no triangle or tetrahedron.
///
/// Adds a step to `steps` for each edge. `association` is that of the mesh, before and afterwards. The result does not
/// depend on the number of threads. Call it inside team.run().
RefineReport refine(HighOrderMesh& mesh, Association& association, const RefineRequest& request,
                    std::vector<RepairStep>& steps, const Team& team);

}  // namespace varimesh
