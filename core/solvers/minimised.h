// What Newton's method minimises, through operations on whole vectors.
#pragma once

namespace varimesh {

/// An objective, a sum of terms over unknowns, with the vectors of a Newton step: the gradient g, the step x, the
/// residual r of H x = −g, the direction p, and q, which is H p or M⁻¹ r in turn. H is the objective's Hessian or a
/// part of it, and M the preconditioner. A node that moves in one, two or three directions has as many unknowns.
///
/// The solver says what happens to whole vectors and never sees a number in them. So an implementation decides where
/// its vectors are, with how many digits, and in which scales; another one may keep them on several machines or on a
/// device. Results must not depend on the number of threads. All functions are called inside team.run(). If the team's
/// token interrupts one, the solver calls go_back().
class Minimised {
 public:
  virtual ~Minimised() = default;

  /// Returns the objective where the unknowns are, +∞ if that is not allowed. Sets g there and what multiply() and
  /// precondition() need, r ← −g, x ← 0. If the objective is infinite, g may be 0.
  /// @param renews  M is made from H anew; otherwise what is dear in it may be as it was
  virtual double linearise(bool renews) = 0;
  /// Takes a positive semidefinite part of H in place of H, makes M from it, and sets r ← −g, x ← 0. False, and nothing
  /// changes, if there is none, or if H is one already.
  virtual bool make_convex() { return false; }

  // === Conjugate gradients ===
  virtual double precondition() = 0;       ///< q ← M⁻¹ r; returns r · q.
  virtual double multiply() = 0;           ///< q ← H p; returns p · q.
  virtual void advance(double alpha) = 0;  ///< x ← x + α p, r ← r − α q
  virtual void turn(double beta) = 0;      ///< p ← q + β p. If β = 0, p ← q, whatever p is.
  virtual void take_direction() = 0;       ///< x ← p

  // === Sizes ===
  /// √(g · g)
  virtual double gradient_norm() = 0;
  /// √(g · M⁻¹ g), by what precondition() has returned when r was −g.
  virtual double preconditioned_norm(double rq) const = 0;
  /// The largest displacement of a node in x, relative to the size of the cells around it.
  virtual double largest_step() = 0;
  /// The largest displacement of a node in q = M⁻¹ r, in the same unit.
  virtual double largest_correction() { return 0; }
  /// The largest displacement of a node in M⁻¹ (g + r), with g where the unknowns are now: how far the linear system is
  /// from the objective. Overwrites g, r, p and q.
  virtual double largest_defect() { return 0; }

  // === The step ===
  /// Makes a step of x that can be taken: an implementation may shorten the displacements of single nodes. Returns
  /// g · x. After that only the functions below are called until the next linearise(), and the sizes of x and q.
  virtual double finish_step() = 0;
  /// A change of the objective by no more than this is rounding.
  virtual double noise() { return 0; }
  /// Moves the unknowns by α x from where linearise() found them, and returns the objective there: +∞ if that is not
  /// allowed. With α = 0 they are exactly where they were.
  virtual double move(double alpha) = 0;
  /// The step ends where move() has put the unknowns.
  virtual void settle() {}
  /// After an interruption: puts the unknowns exactly where linearise() found them. Looks at no token.
  virtual void go_back() {}
};

}  // namespace varimesh
