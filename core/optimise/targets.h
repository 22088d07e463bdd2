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
/// R is one rotation a cell, the one that brings W closest to the straight-sided cell's mean gradient (in the metric,
/// where there is one): the polar factor of S⁻¹ ∇χ_L W⁻¹. Energies that do not change under rotation have the same
/// gradient whatever it is; the small strain needs it, and a metric does in order to meet a prism's or hexahedron's
/// layers the right way up. In a mesh that is clockwise throughout, R turns the regular shape over.
///
/// @param mesh what `problem` was built from
/// @param diagonal the length in the mesh's unit that is 1 in the problem's coordinates: Frame::diagonal
void set_targets(Problem& problem, const HighOrderMesh& mesh, const StretchField& field, double diagonal);

/// Whether the rotations have to follow the cells. With a metric S and R do not commute, so F depends on R even for
/// energies that do not change under rotation: a rotation that is not the cell's own costs energy, and the optimum
/// would depend on where the mesh began.
bool turns_with_cells(const StretchField& field);

/// Fits the rotations again to the cells as `positions` now has them, for a field that turns_with_cells(). What
/// set_targets set stays otherwise, the sign of det A too where a cell has become inverted. Deformation gradients and
/// whatever was derived from the targets are then out of date.
void refit_targets(Problem& problem, const HighOrderMesh& mesh, const StretchField& field, double diagonal);

}  // namespace varimesh
