// What conjugate gradients learn about the spectrum of the preconditioned matrix while they solve.
#pragma once

#include <vector>

namespace varimesh {

/// The tridiagonal matrix T of the Lanczos process that conjugate gradients with a preconditioner M on a matrix A
/// amount to: with their step lengths α and β (conjugate_gradients.h)
///
///     T(j, j) = 1/α_j + β_{j−1}/α_{j−1},   T(j, j + 1) = √β_j / α_j
///
/// (Y. Saad, Iterative Methods for Sparse Linear Systems, 2nd edition, 2003, section 6.7.3). Its eigenvalues, the Ritz
/// values, lie within the spectrum of M⁻¹A, and the outermost ones come close to its ends first. The smallest one tells
/// how far x is from the solution: in the norm of M the error is at most M⁻¹ r divided by the smallest eigenvalue.
class RitzValues {
 public:
  /// Forgets everything.
  void clear();
  /// The next α, positive, and the β after it.
  void advance(double alpha);
  void turn(double beta);

  /// The smallest and the largest eigenvalue of T to a relative accuracy of 1e-3, from below and from above; 0 before
  /// the first advance().
  double smallest() const;
  double largest() const;

  /// The order of T.
  int count() const { return static_cast<int>(diagonal_.size()); }

 private:
  /// How many eigenvalues are below x, by Sturm's sequence.
  int below(double x) const;
  /// Bounds of all eigenvalues, by Gerschgorin's circles, for the largest one.
  double bound() const;

  std::vector<double> diagonal_;
  std::vector<double> square_;  ///< The squares of the entries beside the diagonal.
  double carry_ = 0;            ///< β/α of the iteration before, the second term of the next diagonal entry.
  double last_alpha_ = 0;
};

/// The ends of the spectrum of M⁻¹A.
struct Spectrum {
  double smallest = 0;  ///< 0: not known.
  double largest = 0;

  /// The share of the error that may be left after this many products, in the norm of M:
  /// 2 √κ exp(−2 products / √κ) with κ = largest / smallest, from the bound by Chebyshev polynomials
  /// (Y. Saad, section 6.11.3). Above 1 it says nothing.
  double reduction(int products) const;
};

/// The spectrum as the last few solves with slowly changing A and M tell it.
class SpectrumEstimate {
 public:
  /// Notes a solve that has ended.
  void note(const RitzValues& solve);

  /// The outermost Ritz values of the last few solves and of the one that is running. A short solve may miss the
  /// smallest eigenvalue, so that is 0 unless one of these solves was long enough: 2 √κ products. If eigenvalues lie
  /// densely down to 0, no solve is: the smallest of k Ritz values is then about (1.2 / k)² to (1.9 / k)² of the
  /// largest (the first zeros of the polynomials of Legendre and Jacobi on such a spectrum).
  Spectrum estimate(const RitzValues& running) const;

  template <class Archive>
  void state(Archive& archive) {
    archive(smallest_, largest_, long_enough_);
  }

 private:
  // By solve, the newest last.
  std::vector<double> smallest_, largest_;
  std::vector<char> long_enough_;
};

}  // namespace varimesh
