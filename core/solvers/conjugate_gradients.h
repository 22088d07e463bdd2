// The conjugate gradients of Newton's method and of the untangling, whatever their vectors and matrices are made of.
#pragma once

#include <cstdint>

namespace varimesh {

/// How the conjugate gradients of a Newton step ended.
enum class LinearSolve : std::uint8_t {
  None,               ///< There were none: no Newton step was made.
  Solved,             ///< They reached their forcing term.
  NegativeCurvature,  ///< A direction had no positive curvature. The step is what was found up to there.
  MostProducts,       ///< They made the largest number of products. The step is what was found up to there.
};

/// What conjugate gradients did.
struct ConjugateGradients {
  int products = 0;                 ///< Of the matrix and a direction.
  double residual = 0;              ///< r · M⁻¹ r before the last product.
  bool negative_curvature = false;  ///< The last direction p has p · A p ≤ 0, and no step was taken along it.
  bool solved = false;              ///< The system said that x is good enough, or r · M⁻¹ r fell to 0.
};

/// Solves A x = b for a symmetric matrix A with the preconditioner M: M. R. Hestenes, E. Stiefel, J. Res. Natl. Bur.
/// Stand. 49, 1952, preconditioned as in J. Nocedal, S. J. Wright, Numerical Optimization, 2nd edition, 2006,
/// algorithm 5.3. It stops when the system says that x is good enough, when a direction has no positive curvature, when
/// r · M⁻¹ r is not positive, or after `most_products` products.
///
/// The system holds the vectors: x = 0, r = b and p = M⁻¹ r at the start. It has these functions:
///     double multiply()            A p; returns p · A p
///     void advance(double alpha)   x ← x + α p, r ← r − α A p
///     double precondition()        z = M⁻¹ r; returns r · z
///     bool is_solved(double rz)    whether x is good enough, from r · z > 0
///     void turn(double beta)       p ← z + β p
///
/// @param rz r · M⁻¹ r at the start
template <class System>
ConjugateGradients conjugate_gradients(System& system, double rz, int most_products) {
  ConjugateGradients result;
  result.residual = rz;
  while (result.products < most_products && result.residual > 0) {
    const double curvature = system.multiply();
    ++result.products;
    if (!(curvature > 0)) {
      result.negative_curvature = true;
      break;
    }
    system.advance(result.residual / curvature);
    const double next = system.precondition();
    result.solved = next == 0 || (next > 0 && system.is_solved(next));
    if (result.solved || !(next > 0)) break;
    system.turn(next / result.residual);
    result.residual = next;
  }
  return result;
}

}  // namespace varimesh
