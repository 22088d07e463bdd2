// Proof that a cell is valid, or that it is not: Bernstein coefficients bound its Jacobian with every rounding counted.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"
#include "core/validity/certificate.h"

namespace varimesh {

/// Certifies cells of one mesh as often as its nodes move.
///
/// The method is that of A. Johnen, J.-F. Remacle, C. Geuzaine, Geometrical validity of curvilinear finite elements,
/// J. Comp. Phys. 233, 2013: J is a polynomial (on pyramids after a change of variables, see bernstein.h), so it lies
/// between its least and its greatest Bernstein coefficient; those at corners are values of J. All positive: valid; a
/// corner not positive: invalid; in between, the cell is cut in two where the coefficients bend most.
///
/// Rounding. With u the unit roundoff and γ_k = k u / (1 − k u):
///  - The control points of the derivative g_r are a fixed linear map of the nodes. It is evaluated on x − x₀ (one
///    rounding; x₀ is the cell's first node) with tables whose entries come from exact integers. A sum of n products in
///    any order, with or without fused multiply-add, errs by γ_n Σ |terms|. So component c of a control point errs by
///    at most E_rc = γ_k K_r M_c, with M_c the largest |x − x₀|_c in the cell, K_r the table's largest row sum of
///    absolute values and k the most roundings on any path.
///  - Let H_rc = max_α |ĝ_rαc| + E_rc, which bounds the exact and the computed control points alike. A Bernstein
///    coefficient of J is a convex combination of determinants of control points (one of each g_r), and the product of
///    scaled coefficients is a sum with positive weights that add up to the multinomial it is divided by. Each
///    determinant is a signed sum over permutations, so that each coefficient errs by at most
///        per(E_1, H_2, H_3) + per(H_1, E_2, H_3) + per(H_1, H_2, E_3) + γ_p per(H_1, H_2, H_3),
///    per the permanent of the 3×3 matrix with these rows and p the most roundings on a path through the products.
///    One number a cell, not one a coefficient; it follows the cell's own sizes along and across itself.
///  - Coordinates are scaled by a power of two, which is exact, to a mesh of size about one: nothing overflows, and
///    underflow is covered by an absolute term.
///  - A bisection takes means of neighbours, q times over for degree q: it adds q u max |coefficient|.
/// Where the answer drowns in this error, the cell is done again with nodes converted in 113 bits and products in long
/// double. Only then is it called undecided.
class Certifier {
 public:
  /// Keeps a reference to the mesh, whose elements must stay as they are; its nodes may move.
  explicit Certifier(const HighOrderMesh& mesh, CertificateOptions options = {});

  std::size_t cells() const { return cells_.size(); }

  /// Certifies every cell (elements of dimension mesh.dimension, in the mesh's order) with its nodes at `coordinates`
  /// (x y z of each node of the mesh, interleaved). Call it inside team.run(); the result does not depend on the number
  /// of threads. `certificates` has cells() entries.
  void certify(std::span<const double> coordinates, std::span<Certificate> certificates, const Team& team) const;

  /// Certifies the cells with these numbers (from 0) again and leaves the other entries of `certificates` alone.
  void certify(std::span<const double> coordinates, std::span<const std::int32_t> cells,
               std::span<Certificate> certificates, const Team& team) const;

  /// Sharpens the certificate of the cell with the smallest lower bound of the scaled Jacobian, again and again, until
  /// the mesh's minimum is known to within `gap`: few cells have to be cut. Returns the summary.
  CertificateSummary sharpen(std::span<const double> coordinates, std::span<Certificate> certificates,
                             double gap = 0.002) const;

 private:
  struct Cell {
    const ElementBlock* block;
    const std::int32_t* nodes;
  };
  void certify_run(std::span<const double> coordinates, std::span<const std::int32_t> cells,
                   std::span<Certificate> certificates) const;

  CertificateOptions options_;
  std::vector<Cell> cells_;
  std::vector<std::int32_t> all_;  // 0, 1, 2, …
  double scale_ = 1;               // a power of two
  double sign_ = 1;                // −1 where the mesh is numbered clockwise
};

}  // namespace varimesh
