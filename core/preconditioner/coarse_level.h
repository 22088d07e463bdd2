// The coarse level of the preconditioner: the Hessian for displacements of order 2, with one of order 1 below it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/base/aligned.h"
#include "core/base/team.h"
#include "core/base/work_meter.h"
#include "core/kernels/hessian/batches.h"
#include "core/preconditioner/coarse_kernels.h"
#include "core/preconditioner/coarse_part.h"
#include "core/preconditioner/coarse_space.h"
#include "core/preconditioner/linear_level.h"
#include "core/problem/problem.h"

namespace varimesh {

/// I V Iᵀ. I interpolates displacements of order 2 (of order 1 on a mesh of order 1) at the free nodes. V is one
/// symmetric cycle on their stiffness matrix K: forward block Gauss–Seidel by colours, a correction by the linear level
/// (linear_level.h), backward block Gauss–Seidel. K is assembled from the mean tensors of the cells, which leave out
/// the part of the Hessian that may be negative (HessianKernels::mean_tensors). So K is positive definite for every
/// mesh.
///
/// Let K_ii = L_i L_iᵀ, with its diagonal raised by 1e-6. The level keeps L_i⁻¹, and L_i⁻¹ K_ij L_j⁻ᵀ in steps of
/// 1/32767; none of the entries of L_i⁻¹ K_ij L_j⁻ᵀ is larger than 1. The cycle works on this matrix, whose diagonal is
/// the unit matrix. Steps of the entries of K itself would lose the weak couplings in thin cells beside the strong
/// ones.
class CoarseLevel {
 public:
  /// `batches`: of the problem. solve() overwrites their contributions. All arguments are kept by reference. `part`:
  /// null, or the part that a rank has of a whole problem. `problem` is then the part's problem, and all ranks call
  /// assemble() and solve() together.
  CoarseLevel(const Problem& problem, std::vector<BatchSet>& batches, const Team& team,
              const ProblemPart* part = nullptr);

  /// Assembles the matrix from what `hessian` has linearised. `meter` may be null. It counts assembly_work().
  void assemble(const HessianKernels& hessian, WorkMeter* meter = nullptr);
  /// How many cells and rows assemble() goes through.
  std::int64_t assembly_work() const;

  /// Reads or writes what the matrix is made from, if it will be used again (`is_used`). With a part that is the whole
  /// problem's, so any number of ranks reads what any other has written, and all ranks call it together.
  template <class Archive>
  void state(Archive& archive, bool is_used) {
    tensors_state(archive, is_used);
    if constexpr (Archive::kReads)
      if (is_used) make_matrix();
  }
  /// The same, and leaves the matrix to those who run the cycle elsewhere.
  template <class Archive>
  void tensors_state(Archive& archive, bool is_used) {
    for (std::size_t set = 0; set < tensors_.size() && is_used; ++set) {
      const std::size_t width = at(tensor_size(problem_.dimension));
      std::vector<float> whole;
      if (part_ != nullptr && !Archive::kReads) whole = gather_set(*part_, set, tensors_[set], width);
      std::vector<float>& tensors = part_ != nullptr ? whole : tensors_[set];
      const std::size_t size = at((part_ != nullptr ? *part_->whole : problem_).sets[set].count) * width;
      archive(tensors);
      if constexpr (Archive::kReads) {
        if (tensors.size() != size) archive.fail();
        tensors.resize(size);
        if (part_ != nullptr) take_of_set(*part_, set, whole, width, tensors_[set]);
      }
    }
  }

  /// By set: what assemble() took from the cells, as HessianKernels::mean_tensors.
  const std::vector<std::vector<float>>& tensors() const { return tensors_; }

  /// V Iᵀ r. `shared`: r of each free node divided by the number of its cells, d floats per free node, then padded(d)
  /// zeros.
  void solve(std::span<const float> shared);

  /// The coarse nodes (with ranks: those of the rank's cells and ghosts), and the result of solve(): padded(d) floats
  /// for each.
  const CoarseSpace& space() const { return space_; }
  const float* solution() const { return x_.data(); }

  // For those who run the cycle elsewhere (on_device): what it needs, in this class's own numbering.
  const std::vector<std::int32_t>& colours() const { return colours_; }
  const NodeCells& cells() const { return cells_; }
  const NodePattern& pattern() const { return pattern_; }
  const std::vector<SparseRows>& to_coarse() const { return to_coarse_; }
  const LinearLevel& linear() const { return linear_; }
  std::vector<std::vector<float>>& tensors_to_fill() { return tensors_; }
  /// Assembles only the level of order 1, from the tensors.
  void assemble_below() {
    if (linear_.is_used()) linear_.assemble(tensors_);
  }

 private:
  /// What the levels of a whole problem are made from.
  struct Tables {
    CoarseSpace space;
    std::vector<std::int32_t> colours;
    NodeCells cells;
  };
  static Tables tables_of(const Problem& whole, const Team& team);
  CoarseLevel(const Problem& problem, std::vector<BatchSet>& batches, const Team& team, const ProblemPart* part,
              Tables tables);
  void take_part(const ProblemPart& part);
  void make_vectors();
  /// Nodes of other ranks get the numbers that these ranks have: all nodes, or the nodes of a colour.
  void exchange(UntouchedVector<float>& numbers, std::size_t width) const;
  void exchange_colour(std::size_t colour);
  /// Assembles the matrices of both levels from the tensors.
  void make_matrix(WorkMeter* meter = nullptr);
  template <int d>
  using BlockMatrix = Eigen::Matrix<float, d, d, Eigen::RowMajor>;

  /// M of a cell: a row for each (i j), a column for each (k l).
  template <int d>
  using Tensor = Eigen::Matrix<float, d * d, d * d, Eigen::RowMajor>;

  template <int d>
  Tensor<d> tensor(std::size_t set, std::int32_t cell) const;
  /// The block of a cell between its coarse nodes a and b: M times the means of ∂_k φ_a ∂_l φ_b.
  template <int d>
  static BlockMatrix<d> stiffness(const Tensor<d>& M, const CoarseSpace::Set& set, int a, int b);
  template <int d>
  void factorise_diagonal(std::int32_t node);
  template <int d>
  BlockMatrix<d> inverse_factor(std::int32_t node) const;
  template <int d>
  void assemble_row(std::int32_t node);
  /// Calls body(first, last) for ranges of the coarse nodes from `begin` to `end`.
  template <class Body>
  void for_nodes(std::int32_t begin, std::int32_t end, const Body& body) const;
  /// Adds the correction of the linear level to x.
  template <int d>
  void correct_linear();
  /// Multiplies the result of the cycle with L⁻ᵀ.
  template <int d>
  void unscale();

  const Problem& problem_;
  std::vector<BatchSet>& batches_;
  const Team& team_;
  const ProblemPart* part_;
  CoarseSpace space_;                  ///< Its nodes are sorted by colour.
  std::vector<std::int32_t> colours_;  ///< colours + 1: where each colour's nodes begin.
  NodeCells cells_;                    ///< Of the coarse nodes.
  LinearLevel linear_;
  Halo nodes_, contributions_;  ///< As CoarsePart; empty if there is no part.
  std::vector<Halo> by_colour_;
  std::vector<SparseRows> to_coarse_;        ///< By set: the transpose of its values.
  NodePattern pattern_;                      ///< Of the matrix's blocks, without the diagonal.
  UntouchedVector<std::int16_t> entry_;      ///< As BlockRows::entry.
  UntouchedVector<float> inverse_factor_;    ///< L⁻¹: d columns of d per node, and one more number; 0 if K_ii is 0.
  std::vector<std::vector<float>> tensors_;  ///< By set: as HessianKernels::mean_tensors.
  UntouchedVector<float> r_, x_, residual_;  ///< padded(d) per node.
  BlockRows rows_{};                         ///< Points to the arrays above.
  std::unique_ptr<CoarseKernels> kernels_;
};

}  // namespace varimesh
