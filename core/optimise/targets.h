// What each cell would like to be: the matrix A that the deformation gradient F = ∇χ_M A⁻¹ is measured against.
#pragma once

#include "core/optimise/cells.h"
#include "core/optimise/target_field.h"

namespace varimesh {

/// Sets the targets of all cells (CellBlock::inverse_target, measure, affine) on the vertices of `positions`.
///
/// - Straight-sided: A = ∇χ_L at each quadrature point.
/// - Ideal: A = c R W, W the gradient of the regular shape with edges of length 1 (all edges alike; a square, a cube,
///   an equilateral prism as high as its edges, a pyramid of equilateral sides), c such that the volume is the
///   straight-sided cell's.
/// - Size: A = S R W with S = h or M^(−1/2), so that AᵀMA = WᵀW.
/// - Strain: A = S ∇χ_L with S = 1 + ε or 1 + E.
///
/// R is one rotation a cell, the one that brings W closest to the straight-sided cell's mean gradient: the polar factor
/// of S⁻¹ ∇χ_L W⁻¹. In a mesh that is clockwise throughout it turns the regular shape over. Energies that do not change
/// under rotation come out the same whatever R is, where S is a number; the small strain needs it.
///
/// With a metric S and R do not commute, and a rotation that is wrong by θ shears a target of ratio r by r θ. So the
/// axes of quadrilaterals, hexahedra and prisms are put on the metric's own, whichever are closest. Simplices and
/// pyramids have no axes and lie in the metric as they do in the mesh that came in: those that have to turn much on the
/// way keep some misfit. (Fitting R anew between iterations was tried and does not converge: nothing then holds the
/// cells to the metric's directions. Exact would be an energy of S⁻¹ ∇χ_M W⁻¹, which no target matrix expresses.)
///
/// @param mesh what `problem` was built from
/// @param diagonal the length in the mesh's unit that is 1 in the problem's coordinates: Frame::diagonal
void set_targets(Problem& problem, const HighOrderMesh& mesh, const StretchField& field, double diagonal);

}  // namespace varimesh
