#include "core/optimise/preconditioner.h"

#include <Eigen/Dense>
#include <cmath>

namespace varimesh {
namespace {

constexpr std::int32_t kNodesPerTask = 2048;

template <int d>
void invert_block(const PatchExpansion& expansion, float* inverse) {
  Eigen::Matrix<double, d, d> H;
  for (int i = 0, entry = 0; i < d; ++i)
    for (int j = 0; j <= i; ++j, ++entry) H(i, j) = H(j, i) = expansion.hessian[entry];
  // Pivots of a Cholesky factor bound the eigenvalues' ratio from outside: where they are alike nothing is clamped.
  Eigen::Matrix<double, d, d> out;
  const Eigen::LLT<Eigen::Matrix<double, d, d>> factor(H);
  const auto pivots = factor.matrixLLT().diagonal();
  if (factor.info() == Eigen::Success && pivots.minCoeff() > 0.2 * pivots.maxCoeff()) {
    out = factor.solve(Eigen::Matrix<double, d, d>::Identity());
  } else {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, d, d>> eigen(H);
    const Eigen::Matrix<double, d, 1> size = eigen.eigenvalues().cwiseAbs();
    const Eigen::Matrix<double, d, 1> clamped = size.cwiseMax(std::max(1e-3 * size.maxCoeff(), 1e-300));
    out = eigen.eigenvectors() * clamped.cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose();
  }
  for (int i = 0; i < d; ++i)
    for (int j = 0; j < d; ++j) inverse[i * d + j] = static_cast<float>(out(i, j));
}

template <int d>
void multiply_block(const float* block, const float* r, float* z) {
  for (int i = 0; i < d; ++i) {
    z[i] = 0;
    for (int j = 0; j < d; ++j) z[i] += block[i * d + j] * r[j];
  }
}

}  // namespace

Preconditioner::Preconditioner(const Problem& problem, const Team& team)
    : problem_(problem), team_(team), inverse_blocks_(problem.free.size() * problem.dimension * problem.dimension) {}

void Preconditioner::set_block(std::int32_t rank, const PatchExpansion& expansion) {
  const int d = problem_.dimension;
  float* inverse = inverse_blocks_.data() + static_cast<std::size_t>(rank) * d * d;
  d == 2 ? invert_block<2>(expansion, inverse) : invert_block<3>(expansion, inverse);
}

void Preconditioner::apply(std::span<const float> r, std::span<float> z) const {
  const int d = problem_.dimension;
  team_.for_each(static_cast<std::int32_t>(problem_.free.size()), kNodesPerTask, [&](std::int32_t rank) {
    const std::size_t at = static_cast<std::size_t>(rank) * d;
    const float* block = inverse_blocks_.data() + at * d;
    d == 2 ? multiply_block<2>(block, &r[at], &z[at]) : multiply_block<3>(block, &r[at], &z[at]);
  });
}

}  // namespace varimesh
