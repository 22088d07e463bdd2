// Solves the problem of order 1: by a sparse factor if it is small, by multigrid if it is large.
#pragma once

#include <Eigen/SparseCholesky>
#include <cstdint>
#include <vector>

#include "core/base/team.h"
#include "core/multigrid/multigrid.h"

namespace varimesh {

/// An approximate inverse of a sparse symmetric positive definite matrix with one unknown per vertex: a symmetric
/// positive definite linear operator, fixed until the next factorise(). Up to a number of vertices it is the exact
/// inverse, by sparse Cholesky. The fill of a factor grows faster than the mesh, so above that number it is one
/// multigrid cycle, whose memory and time are proportional to the number of entries.
class LinearSolver {
 public:
  using Matrix = Eigen::SparseMatrix<double>;

  /// With more vertices than this a factor takes more memory and time than it saves.
  static constexpr std::int32_t kMostFactored = 200000;

  /// `team` must outlive it.
  explicit LinearSolver(const Team& team, std::int32_t most_factored = kMostFactored)
      : team_(team), most_factored_(most_factored), multigrid_(team) {}

  /// Takes the pattern of the lower triangle of the matrix. To be called once, before the first factorise().
  void analyse(const Matrix& lower);

  /// Takes the values, in the same pattern. False if there is no factor: the matrix is not positive definite.
  bool factorise(const Matrix& lower);

  /// Both matrices: vertices × d, d at most 3.
  void solve(const Eigen::MatrixXd& right, Eigen::MatrixXd& solution);

 private:
  void set_up_multigrid(const Matrix& lower);
  void apply_multigrid(const Eigen::MatrixXd& right, Eigen::MatrixXd& solution);

  const Team& team_;
  std::int32_t most_factored_;
  bool is_factored_ = true;  ///< Else multigrid_ is used.
  Eigen::SimplicialLDLT<Matrix> factor_;
  Multigrid multigrid_;
  std::vector<double> right_, solution_;  ///< Of multigrid_: vertices × d, d innermost.
};

}  // namespace varimesh
