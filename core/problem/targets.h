// What each cell would like to be: the matrix A that the deformation gradient F = ∇χ_M A⁻¹ is measured against.
#pragma once

#include "core/problem/problem.h"
#include "core/problem/target_field.h"

namespace varimesh {

/// Sets the targets of all cells (CellSet::inverse_target, measure, affine, uniform_target, left_factor) on the
/// vertices of `positions`.
///
/// - Straight-sided: A = ∇χ_L at each quadrature point.
/// - Ideal: A = c R W, W the gradient of the regular shape with edges of length 1 (all edges alike; a square, a cube,
///   an equilateral prism as high as its edges, a pyramid of equilateral sides), c such that the volume is the
///   straight-sided cell's.
/// - Size: A = S R W with S = h or M^(−1/2), so that AᵀMA = WᵀW. Simplices and pyramids in a metric: A = s R W with s =
///   (det S)^(1/d) at each point and the left factor L = s S⁻¹ of the cell's mean S: the same S R W is L⁻¹ A.
/// - Strain: A = S ∇χ_L with S = 1 + ε or 1 + E.
///
/// R is one rotation a cell, the one that brings W closest to the straight-sided cell's mean gradient: the polar factor
/// of S⁻¹ ∇χ_L W⁻¹. In a mesh that is clockwise throughout it turns the regular shape over. Energies that do not change
/// under rotation come out the same whatever R is, where S is a number; the small strain needs it.
///
/// With a metric of ratio r, S and R do not commute, and a rotation that is wrong by θ shears the target by r θ.
/// Simplices and pyramids have no axes by which to tell the rotation, so S stands on the left of ∇χ_M as L, and R drops
/// out: they may turn in the metric as they like. Its directions and ratios are one a cell then, and a cell that the
/// metric turns or curves away from by θ is sheared by r θ. The axes of quadrilaterals, hexahedra and prisms are put on
/// the metric's own, whichever are closest, and S stays on the right: it is they that lie on curved walls with a ratio
/// of 100, where the wall turns away from one metric a cell by more than 1/r.
///
/// The small strain needs R on either side: what must turn on the way keeps some misfit.
///
/// @param diagonal the length in the mesh's unit that is 1 in the problem's coordinates: Frame::diagonal
void set_targets(Problem& problem, const StretchField& field, double diagonal);

/// Makes det A of every cell's target the same at all its points, their mean, by scaling A there: a target whose own
/// scaled Jacobian is 1, of the same shape at every point. Nothing changes where the target is one matrix a cell.
void level_targets(Problem& problem);

}  // namespace varimesh
