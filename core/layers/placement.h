// Where the nodes of layers lie on surfaces parallel to the wall. Internal to core/layers.
#pragma once

#include <cstdint>
#include <vector>

#include "core/layers/columns.h"
#include "core/layers/flat_sides.h"
#include "core/options/options.h"

namespace varimesh::detail {

/// A cell between two levels of the columns above one facet of the wall.
struct LayerCell {
  std::int32_t cell = -1;   ///< In the mesh's order.
  std::int32_t facet = -1;  ///< Columns::facets.
  std::int32_t level = 0;   ///< Of its upper vertices; at least 1.
  double height = 0;        ///< The shortest edge of the columns in it, in the unit of length of the mesh.
  double width = 0;         ///< The shortest edge along the wall, at its lower and its upper level.
};

/// Where the nodes of layers lie in the mesh as it is, and where they would lie on parallel surfaces.
struct Placement {
  std::vector<LayerCell> cells;
  std::vector<std::int32_t> nodes;  ///< Nodes of these cells above the wall, sorted.
  std::vector<double> coordinates;  ///< 3 for each of `nodes`, interleaved.
  std::vector<double> normals;      ///< In the same way: unit vectors, away from the wall.
};

/// A node of a layer has coordinates in the layers: a point of the wall, and a level s, a number between the levels of
/// the vertices. Both are the linear blends of the values at the vertices of the cell. The columns say how high the
/// level s is above each vertex p of the facet: G_p(s) is the vector from p to the node on the column at this level.
/// With the normals n of the wall at the point and n_p at the vertices, and the blend N_p of the facet, the node lies
/// at
///
///     w + n Σ N_p n_p·G_p(s) + (1 − n nᵀ) Σ N_p (1 − n_p n_pᵀ) G_p(s),
///
/// w being the point on the curved wall. On a circle or a sphere with columns along its normals, that is on a
/// concentric one. Nodes on columns keep their place, or go to the spacing that is wanted (spacing.h). Where cells
/// disagree, as on both sides of an edge of the wall, the mean counts. Nodes at the top of a cell may be
/// fixed away from the parallel surface, as on a far boundary with straight sides. Then each node below such a node is
/// shifted by a share of its distance from that surface: 0 at the lower level of the cell and 1 at the upper one.
///
/// @param fixed  by node, whether it must stay
/// @param sides  on which fixed nodes may move; they stay on these sides
Placement place_in_layers(const HighOrderMesh& mesh, const Columns& columns, LayerSpacing spacing,
                          const std::vector<bool>& fixed, const FlatSides& sides = {});

}  // namespace varimesh::detail
