// How much accuracy a solver loses because cells are curved: an indicator that needs no solver.
#pragma once

#include <cstddef>
#include <vector>

#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// The loss of accuracy of a mesh, dimensionless.
///
/// The map χ of a cell E from its reference cell Ê is a sum of parts χ_s of degree s = 0 … P, orthogonal in L²(Ê). The
/// degree is that of reference::modal_degrees(): a straight-sided cell has no parts above degree 1. J is the mean of ∇χ
/// over Ê. The part of degree s is measured by the displacement gradient that it adds to the cell with the gradient J:
///
///     m_s² = 1/|Ê| ∫_Ê |∇χ_s J⁻¹|²,   s = 2 … P.
///
/// A solver on isoparametric cells has the polynomials of degree P in reference coordinates. The monomials x^α of
/// physical space are among them only if the cell is straight-sided: x^α∘χ with |α| = P + 2 − s has terms above degree
/// P as soon as χ has a part of degree s. A solution with the wave number k therefore loses (k h)^(P+1−s) m_s in its
/// gradient, where h is the size of the cell. With h = V_E^(1/d), the volume V_E = |Ê| |det J|, and k = V^(−1/d), the
/// wave number of a solution as large as the mesh (V = Σ_E V_E), the losses of a cell and of the mesh are
///
///     a_E² = Σ_{s=2..P} (V_E/V)^(2(P+1−s)/d) m_s²,   a² = 1/V Σ_E V_E a_E².
///
/// They do not change if the mesh is moved, turned or scaled. Theory: P. G. Ciarlet, P.-A. Raviart, Interpolation
/// theory over curved elements, Comput. Methods Appl. Mech. Engrg. 1, 1972; M. Lenoir, Optimal isoparametric finite
/// elements and error estimates for domains involving curved boundaries, SIAM J. Numer. Anal. 23, 1986.
/// docs/accuracy.md compares it with the error of a solver.
struct Accuracy {
  double loss = 0;                  ///< a. 0 if all cells are straight-sided; infinite if det J = 0 in a cell.
  std::vector<double> modal_parts;  ///< (1/V Σ_E V_E m_s²)^½ for s = 2 … P.
};

/// The same of each cell (elements of dimension mesh.dimension, in the mesh's order).
struct CellAccuracy {
  std::size_t parts = 0;            ///< P − 1, the number of parts of each cell.
  std::vector<double> loss;         ///< a_E.
  std::vector<double> modal_parts;  ///< m_s: [cell][s − 2].
  std::vector<double> volumes;      ///< V_E, in the unit of length to the power d.
};

/// @param threads how many threads to use; 0: all of the machine's. The result does not depend on it.
/// The mesh must have passed check_structure().
CellAccuracy cell_accuracy(const HighOrderMesh& mesh, int threads = 0);
Accuracy accuracy(const HighOrderMesh& mesh, int threads = 0);

}  // namespace varimesh
