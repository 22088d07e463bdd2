// Algebraic multigrid for sparse symmetric positive definite matrices with one unknown per vertex.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/preconditioner/multigrid/aggregation.h"
#include "core/preconditioner/multigrid/dense_factor.h"
#include "core/preconditioner/multigrid/level_matrix.h"
#include "core/preconditioner/multigrid/sparse_rows.h"

namespace varimesh {

/// A preconditioner for matrices like those of a diffusion problem in linear functions, by smoothed aggregation (Vaněk,
/// Mandel and Brezina, "Algebraic multigrid by smoothed aggregation for second and fourth order elliptic problems",
/// Computing 56, 1996). Rows that are strongly connected are grouped into aggregates, one unknown of the next level for
/// each; constants on aggregates, smoothed by one step of Jacobi's method, are its functions. Time and memory are
/// proportional to the number of entries.
///
/// apply() is one V-cycle, Chebyshev smoothing before and after each correction, a dense factor at the end: a symmetric
/// positive definite linear operator, the same in every call, as conjugate gradients need it. All work is shared by the
/// team's threads. Sums are in a fixed order: the result is the same to the last bit for any number of threads.
///
/// Entries are kept in single precision (LevelMatrix says what that changes). It is meant for matrices whose smallest
/// eigenvalue is above about 1e-6 once the diagonal is scaled to 1, or whose entries off the diagonal are negative.
class Multigrid {
 public:
  /// `team` must outlive it.
  explicit Multigrid(const Team& team) : team_(team) {}

  /// Takes a matrix; its arrays are not needed afterwards. It must be symmetric, its pattern too. A row whose diagonal
  /// entry is not positive and finite is left out: apply() gives 0 there.
  void set_up(const CompressedRows& matrix);

  /// Takes a matrix with the same pattern but other values, and keeps the aggregates of the one before. With the same
  /// values it gives what set_up() gives.
  void update(const CompressedRows& matrix);

  /// One cycle for each column of `right`. Both arrays: rows × columns, columns innermost; 1 ≤ columns ≤ 3.
  void apply(std::span<const double> right, std::span<double> solution, int columns);

  /// Rows of each level, the finest first.
  std::vector<std::int32_t> level_rows() const;
  /// What the levels hold.
  std::size_t bytes() const;
  /// The same before there is a matrix, for one with this many rows and entries off the diagonal, and `columns` as in
  /// apply(). An estimate from grids of squares, triangles, cubes and tetrahedra.
  static std::int64_t bytes_needed(std::int64_t rows, std::int64_t entries, int columns);

  struct Level {
    multigrid::LevelMatrix matrix;
    double largest = 0;  ///< Of the eigenvalues of D⁻¹A.
    multigrid::Aggregates aggregates;
    multigrid::FloatRows prolongator, restrictor;  ///< No rows on the last level.
    std::vector<double> right, solution, scratch;
  };
  /// For those who run the cycle elsewhere: the levels, the finest first, and the factor of the last one; null: the
  /// last level is only smoothed.
  const std::vector<Level>& levels() const { return levels_; }
  const multigrid::DenseFactor* coarsest() const { return is_dense_ ? &coarsest_ : nullptr; }

 private:
  void build(const CompressedRows& matrix, bool keeps_aggregates);
  template <int d>
  void cycle(std::size_t level, const double* right, double* solution);
  template <int d>
  void correct(std::size_t level, const double* right, double* solution);

  const Team& team_;
  std::vector<Level> levels_;
  multigrid::DenseFactor coarsest_;
  bool is_dense_ = false;  ///< The last level is solved by coarsest_, else only smoothed.
};

}  // namespace varimesh
