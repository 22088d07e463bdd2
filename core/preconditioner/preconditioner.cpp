#include "core/preconditioner/preconditioner.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace varimesh {
namespace {

constexpr std::size_t kNodesPerTask = 2048, kFloatsPerTask = 16384;
constexpr double kLeastEigenvalue = 1e-3;  // of a block, relative to its largest
constexpr double kNothing = 1e-34;  // the largest blocks are about 1; the inverse of a smaller one may not fit a float

template <int d>
void invert_block(const std::array<double, 6>& triangle, float* inverse) {
  Eigen::Matrix<double, d, d> H;
  for (int i = 0, entry = 0; i < d; ++i)
    for (int j = 0; j <= i; ++j, ++entry) H(i, j) = H(j, i) = triangle[entry];
  if (!(H.norm() >= kNothing)) {
    std::fill_n(inverse, triangle_size(d), 0.0F);  // the node does not move until the block is larger
    return;
  }
  // |H| |H⁻¹| in the Frobenius norm bounds the ratio of the eigenvalues. If it is small, nothing has to be clamped.
  Eigen::Matrix<double, d, d> out;
  const Eigen::LLT<Eigen::Matrix<double, d, d>> factor(H);
  if (factor.info() == Eigen::Success) out = factor.solve(Eigen::Matrix<double, d, d>::Identity());
  if (factor.info() != Eigen::Success || !(H.norm() * out.norm() <= 1 / kLeastEigenvalue)) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, d, d>> eigen(H);
    const Eigen::Matrix<double, d, 1> size = eigen.eigenvalues().cwiseAbs();
    const Eigen::Matrix<double, d, 1> clamped = size.cwiseMax(kLeastEigenvalue * size.maxCoeff());
    out = eigen.eigenvectors() * clamped.cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose();
  }
  for (int i = 0; i < d; ++i)
    for (int j = 0; j <= i; ++j) *inverse++ = static_cast<float>(out(i, j));
}

const Problem& whole_of(const Problem& problem, const ProblemPart* part) {
  return part != nullptr ? *part->whole : problem;
}

}  // namespace

Preconditioner::Preconditioner(const Problem& problem, std::vector<BatchSet>& batches, const Team& team,
                               const ProblemPart* part)
    : problem_(problem),
      team_(team),
      part_(part),
      own_nodes_(part != nullptr ? static_cast<std::size_t>(part->share.own_nodes) : problem.free.size()),
      coarse_(problem, batches, team, part),
      stretched_(whole_of(problem, part), batches, StretchedCells::most_cells(whole_of(problem, part)), team, part),
      kernels_(make_coarse_kernels(problem.dimension)),
      inverse_blocks_(own_nodes_ * triangle_size(problem.dimension)),
      reduction_(whole_reduction(team, part)) {
  team.for_ranges(inverse_blocks_.size(), kFloatsPerTask, [&](std::size_t begin, std::size_t end) {
    std::fill_n(inverse_blocks_.data() + begin, end - begin, 0.0F);
  });
}

void Preconditioner::set_block(std::int32_t rank, const std::array<double, 6>& triangle) {
  const int d = problem_.dimension;
  float* inverse = inverse_blocks_.data() + static_cast<std::size_t>(rank) * triangle_size(d);
  d == 2 ? invert_block<2>(triangle, inverse) : invert_block<3>(triangle, inverse);
}

void Preconditioner::assemble(const HessianKernels& hessian, WorkMeter* meter) {
  coarse_.assemble(hessian, meter);
  stretched_.assemble(coarse_.tensors());
}

double Preconditioner::apply(std::span<const float> r, std::span<float> z) {
  const std::size_t d = problem_.dimension;
  // Before z is known, its memory holds r of each node divided by the number of its cells.
  team_.for_ranges(own_nodes_, kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t rank = begin; rank < end; ++rank) {
      const float share = 1 / static_cast<float>(problem_.offsets[rank + 1] - problem_.offsets[rank]);
      for (std::size_t k = rank * d; k < (rank + 1) * d; ++k) z[k] = share * r[k];
    }
  });
  if (part_ != nullptr) part_->share.directions.exchange(z.data(), d, *part_->share.ranks);
  coarse_.solve(z);
  const double along = reduction_.sum_of_blocks(own_nodes_, kNodesPerTask, [&](std::size_t begin, std::size_t end) {
    return kernels_->precondition(problem_, coarse_.space(), coarse_.solution(), inverse_blocks_.data(), r.data(),
                                  z.data(), static_cast<std::int32_t>(begin), static_cast<std::int32_t>(end));
  });
  return along + stretched_.add(r, z);
}

}  // namespace varimesh
