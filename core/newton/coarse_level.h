// The coarse part of the preconditioner: the Hessian on quadratic displacements, and below it on linear ones.
#pragma once

#include <Eigen/SparseCholesky>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/base/aligned.h"
#include "core/base/team.h"
#include "core/hessian/batches.h"
#include "core/newton/coarse_kernels.h"
#include "core/newton/coarse_space.h"
#include "core/problem/problem.h"

namespace varimesh {

/// I V Iᵀ. I takes displacements of order 2 (of order 1 on a mesh of order 1) to the free nodes, and V is one
/// symmetric cycle on their stiffness matrix: forward block Gauss–Seidel by colours, the problem of order 1 by sparse
/// Cholesky, backward block Gauss–Seidel. Of the problem of order 1 only what a direction does to itself is kept, its
/// mean over the directions: one scalar factor for all of them, with the same number of iterations as the whole. The
/// matrix is made of each cell's mean tensor, from which the part of the Hessian that need not be positive is left out
/// (HessianKernels::mean_tensors), so that it is positive definite whatever the mesh.
///
/// Of the matrix K, its diagonal raised by 1e-6, L_i⁻¹ of K_ii = L_i L_iᵀ is kept, and L_i⁻¹ K_ij L_j⁻ᵀ, of which no
/// number is larger than 1, in steps of 1/32767: the cycle is on that, which has the unit matrix on its diagonal. Steps
/// of K's own entries would lose what is weak in thin cells beside what is strong.
class CoarseLevel {
 public:
  /// `batches` of the problem; their parts are where restriction adds up.
  CoarseLevel(const Problem& problem, std::vector<BatchSet>& batches, const Team& team);

  /// The matrix anew, from what `hessian` has linearised.
  void assemble(const HessianKernels& hessian);

  /// What the matrix is made of, where it will be used again.
  template <class Archive>
  void state(Archive& archive, bool is_used) {
    archive(solves_linear_);
    for (std::vector<float>& tensors : tensors_) {
      const std::size_t size = tensors.size();
      if (is_used) archive(tensors);
      if constexpr (Archive::kReads)
        if (tensors.size() != size) archive.fail();
      tensors.resize(size);
    }
    if constexpr (Archive::kReads)
      if (is_used) make_matrix();
  }

  /// V Iᵀ r, of `shared`, which has for each free node its part of r a cell: r over the number of its cells, d floats,
  /// then padded(d) zeros.
  void solve(std::span<const float> shared);

  /// Where the coarse nodes are, and padded(d) floats for each.
  const CoarseSpace& space() const { return space_; }
  const float* solution() const { return x_.data(); }

 private:
  /// From the tensors.
  void make_matrix();
  void colour();
  void find_neighbours();
  template <int d>
  using BlockMatrix = Eigen::Matrix<float, d, d, Eigen::RowMajor>;

  /// A row for each (i j), a column for each (k l).
  template <int d>
  using Tensor = Eigen::Matrix<float, d * d, d * d, Eigen::RowMajor>;

  template <int d>
  Tensor<d> tensor(std::size_t set, std::int32_t cell) const;
  /// M times the means of ∂_k φ_a ∂_l φ_b: the cell's block between its coarse nodes a and b.
  template <int d>
  static BlockMatrix<d> stiffness(const Tensor<d>& M, const CoarseSpace::Set& set, int a, int b);
  template <int d>
  void factorise_diagonal(std::int32_t node);
  template <int d>
  BlockMatrix<d> inverse_factor(std::int32_t node) const;
  template <int d>
  void assemble_row(std::int32_t node);
  /// Calls body(set, cell, i, j, row, column) for every cell's linear nodes i and j of which the one's number is not
  /// below the other's: the lower triangle.
  template <class Body>
  void for_linear_pairs(const Body& body) const;
  void find_linear_pattern();
  template <int d>
  void assemble_linear();
  /// Calls body(first, last) for ranges of the coarse nodes from `begin` to `end`.
  template <class Body>
  void for_nodes(std::int32_t begin, std::int32_t end, const Body& body) const;
  template <int d>
  void correct_linear();
  /// L⁻ᵀ times what the cycle has found.
  template <int d>
  void unscale();

  const Problem& problem_;
  std::vector<BatchSet>& batches_;
  const Team& team_;
  CoarseSpace space_;                   ///< Of order 2; its nodes are sorted by colour.
  CoarseSpace linear_;                  ///< Of order 1.
  std::vector<SparseRows> to_coarse_;   ///< Of each set, the transpose of its values.
  SparseRows from_linear_, to_linear_;  ///< Values of order 2 from those of order 1, and the transpose.
  std::vector<std::int32_t> colours_;   ///< Where each colour's nodes begin, and their end.
  std::vector<std::int32_t> places_begin_;
  std::vector<Incidence> places_;            ///< The cells of each coarse node.
  std::vector<std::int64_t> row_begin_;      ///< Block rows.
  std::vector<std::int32_t> column_;         ///< Ascending in a row.
  AlignedVector<std::int16_t> entry_;        ///< As BlockRows has them.
  AlignedVector<float> inverse_factor_;      ///< L⁻¹, d columns of d a node, and one more number; 0 where K_ii is.
  std::vector<std::vector<float>> tensors_;  ///< By set: as HessianKernels::mean_tensors.
  AlignedVector<float> r_, x_, residual_;    ///< padded(d) a node.
  BlockRows rows_{};                         ///< All of these.
  std::unique_ptr<CoarseKernels> kernels_;
  Eigen::SparseMatrix<double> linear_matrix_;  ///< Lower triangle.
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor_;
  bool solves_linear_ = false;
  Eigen::MatrixXd linear_right_, linear_left_;  ///< linear nodes × d
};

}  // namespace varimesh
