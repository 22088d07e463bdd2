// Proof that a cell is valid, or that it is not: Bernstein coefficients bound its Jacobian with every rounding counted.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/mesh/high_order_mesh.h"
#include "core/team.h"

namespace varimesh {

/// What is proved about one cell. Bounds are of J = det ∇χ_M with respect to the reference cell (shape.h), relative to
/// the mesh's orientation, in the cube (square) of the file's unit of length; they hold for the coordinates as given.
struct Certificate {
  enum class Answer : std::uint8_t {
    Valid,      ///< J > 0 in the whole cell.
    Invalid,    ///< J ≤ 0 at `place`.
    Undecided,  ///< Neither, at the depth allowed; never counted as valid.
  };
  Answer answer = Answer::Undecided;
  double lower_bound = -std::numeric_limits<double>::max();  ///< J is nowhere smaller.
  double upper_bound = std::numeric_limits<double>::max();   ///< J is nowhere greater.
  /// min J / max J is no smaller; −1 where J is proved nowhere positive; the lowest double where nothing is known.
  double scaled_jacobian_lower_bound = -std::numeric_limits<double>::max();
  std::array<double, 3> place{};  ///< Physical coordinates where J ≤ 0 (invalid) or where it is in doubt (undecided).
};

/// How far a certificate goes.
struct CertificateOptions {
  int max_depth = 60;    ///< Bisections one inside the other. Three halve a 3-D cell's size.
  int max_cells = 4000;  ///< Parts that one cell may be cut into.
  /// Beyond the answer, bounds are sharpened until min J / max J is known to within this; infinity: not at all.
  double gap = std::numeric_limits<double>::infinity();
};

/// The certificates of a mesh in four numbers.
struct CertificateSummary {
  std::int64_t valid = 0;
  std::int64_t invalid = 0;
  std::int64_t undecided = 0;
  double min_scaled_jacobian_lower_bound = 0;  ///< Smallest over the cells.
};

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

CertificateSummary summarise(std::span<const Certificate> certificates);

/// Certifies a whole mesh once. `threads` 0 means all.
std::vector<Certificate> certify(const HighOrderMesh& mesh, const CertificateOptions& options = {}, int threads = 0);

}  // namespace varimesh
