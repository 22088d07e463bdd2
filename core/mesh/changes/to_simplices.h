// Cuts all cells into triangles or tetrahedra.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// The mesh with triangles in place of quadrilaterals, and tetrahedra in place of pyramids, prisms and hexahedra;
/// boundary elements too. A quadrilateral gets the diagonal from its lowest vertex, and a cell the tetrahedra from its
/// lowest vertex to the triangles of the facets that do not have it. So cells that share a face get the same triangles.
/// Vertices are ordered by index; a vertex with a periodic master counts as its master, so that periodic faces get
/// the same triangles as well.
///
/// No node is new or moves: the nodes of the simplices are nodes of their parents. A curved simplex has a polynomial of
/// its own through them, so a mesh of curved cells should be judged again. The first simplex of an element keeps its
/// number. Fields on elements in sections that VariMesh does not use ($ElementData, $ElementNodeData) are dropped.
/// Errors: BadInput as for check_blocks(), or if there would be too many cells.
/// @param parents  by cell of the result, gets the cell that it is a part of; may be null
Expected<HighOrderMesh> to_simplices(const HighOrderMesh& mesh, std::vector<std::int32_t>* parents = nullptr);

}  // namespace varimesh
