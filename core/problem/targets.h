// The targets of the cells: the matrix A in the deformation gradient F = ∇χ_M A⁻¹, which is 1 in a cell that is its
// target.
#pragma once

#include "core/problem/problem.h"
#include "core/problem/substitute_shapes.h"
#include "core/problem/target_field.h"

namespace varimesh {

/// Sets the targets of all cells (CellSet::inverse_target, measure, affine, uniform_target, left_factor) on the
/// vertices of `positions`, and their sizes (sizes.h).
///
/// - Straight-sided: A = ∇χ_L at each quadrature point.
/// - Ideal: A = c R W. W is the gradient of the regular shape with edges of length 1 (an equilateral triangle or
///   tetrahedron, a square, a cube, an equilateral prism as high as its edges, a pyramid of equilateral sides). c is
///   such that the volume is that of the straight-sided cell.
/// - Size: A = S R W with S = h or M^(−1/2), so that AᵀMA = WᵀW. Simplices and pyramids in a metric: A = s R W with s =
///   (det S)^(1/d) at each point and the left factor L = s S⁻¹ of the cell's mean S; then S R W is L⁻¹ A.
/// - Strain: A = S ∇χ_L with S = 1 + ε or 1 + E.
///
/// R is one rotation per cell, the one that brings W closest to the mean gradient of the straight-sided cell: the polar
/// factor of S⁻¹ ∇χ_L W⁻¹. In a mesh that is clockwise throughout R mirrors the regular shape. If S is a number,
/// energies that are invariant under rotation do not depend on R; the small strain does.
///
/// With a metric of ratio r, S and R do not commute, and a rotation that is wrong by θ shears the target by r θ.
/// Simplices and pyramids have no axes that determine the rotation. For them S stands on the left of ∇χ_M as L, and R
/// drops out: they may rotate freely in the metric. The directions and ratios of the metric are then constant in the
/// cell, and if the metric turns by θ within the cell, the target is sheared by r θ. The axes of quadrilaterals,
/// hexahedra and prisms are aligned with the closest axes of the metric, and S stays on the right. These are the cells
/// that lie on curved walls with a ratio of 100, where the wall turns within a cell by more than 1/r.
///
/// The small strain depends on R on either side, so a cell that has to rotate keeps some misfit.
///
/// @param field from resolve_target_field(); without components for targets without a field
/// @param diagonal Frame::diagonal, the length in the mesh's unit that is 1 in the problem's coordinates
/// @param substitutes cells in it take the vertices there in place of their own, for every kind of target
///
/// Call it inside team.run().
void set_targets(Problem& problem, const StretchField& field, double diagonal, const SubstituteShapes& substitutes = {},
                 const Team& team = Team(1));

/// Scales the targets so that det A is the same at all points of a cell, namely its mean: the scaled Jacobian of the
/// target itself is then 1, and its shape at each point is unchanged. Affine sets do not change.
void level_targets(Problem& problem);

}  // namespace varimesh
