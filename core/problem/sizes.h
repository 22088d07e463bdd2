// The lengths that displacements are measured by: the size of each cell, and of the cells around each free node.
#pragma once

#include "core/base/team.h"
#include "core/problem/problem.h"

namespace varimesh {

/// Sets Problem::cell_size and Problem::inverse_size from the vertices of `positions`.
///
/// The size of a cell is its shortest height: for each of its facets (faces in 3-D, edges in 2-D) the distance of the
/// farthest vertex from the facet, in the affine cell with the gradient that the straight-sided cell has at the mean of
/// its vertices. For triangles, tetrahedra, parallelograms and parallelepipeds these are the heights themselves. In a
/// boundary layer the size is the thickness of the layer. In units of this size, a node that moves along the wall by
/// the length of a cell moves far, and a node that moves by the thickness moves by 1.
///
/// A height that is shorter than 1e-6 of the distance of a vertex from the mean counts as that long, so a
/// straight-sided cell without volume has a size too.
///
/// Call it inside team.run().
void set_sizes(Problem& problem, const Team& team = Team(1));

}  // namespace varimesh
