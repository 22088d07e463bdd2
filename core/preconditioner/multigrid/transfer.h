// From one level to the next: the smoothed prolongator and the matrix of the coarser level.
#pragma once

#include "core/base/team.h"
#include "core/preconditioner/multigrid/aggregation.h"
#include "core/preconditioner/multigrid/level_matrix.h"
#include "core/preconditioner/multigrid/sparse_rows.h"

namespace varimesh::multigrid {

/// P = (I − ω D_F⁻¹ A_F) T, rows × aggregates. T has a 1 in row i at i's aggregate. A_F is A with every entry off the
/// diagonal that is not strong added to the diagonal: without the filter, P would spread along the long side of a
/// stretched mesh and the coarser matrices would fill (Vaněk, Mandel and Brezina, "Algebraic multigrid by smoothed
/// aggregation for second and fourth order elliptic problems", Computing 56, 1996). All entries of A_F off the diagonal
/// are negative; if a row of it adds up to less than 0, its diagonal is raised, so that the eigenvalues of D_F⁻¹ A_F
/// are at most 2. ω = 2/3 is the (4/3)/λ of smoothed aggregation for that bound.
///
/// A row in no aggregate takes what its strong neighbours give it (ω = 1 there); a row for which is_alone() holds is
/// zero.
FloatRows prolongator(const Team& team, const LevelMatrix& matrix, const Strength& strength,
                      const Aggregates& aggregates);

/// Pᵀ A P; `restrictor` is Pᵀ.
LevelMatrix coarse_matrix(const Team& team, const LevelMatrix& matrix, const FloatRows& prolongator,
                          const FloatRows& restrictor);

}  // namespace varimesh::multigrid
