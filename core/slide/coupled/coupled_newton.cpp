#include "core/slide/coupled/coupled_newton.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "core/base/index.h"
#include "core/base/line_search.h"

namespace varimesh::detail {
namespace {

constexpr std::int32_t kNodesPerTask = 256;
constexpr int kMostProducts = 300;
constexpr int kFewProducts = 10;
constexpr double kForcing = 0.02;     // a step is solved to this share of its initial residual
constexpr int kMostTrials = 14;       // of a line search
constexpr double kLeastShare = 1e-6;  // of a block's largest eigenvalue: smaller ones count as this one

/// A node's block of the Hessian from its lower triangle by rows.
Eigen::Matrix3d full(const std::array<double, 6>& lower) {
  Eigen::Matrix3d block;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j <= i; ++j) block(i, j) = block(j, i) = lower[at(lower_index(i, j))];
  return block;
}

Eigen::Map<const Eigen::Vector3d> node(const std::vector<double>& numbers, std::size_t rank) {
  return Eigen::Map<const Eigen::Vector3d>(&numbers[3 * rank]);
}
Eigen::Map<Eigen::Vector3d> node(std::vector<double>& numbers, std::size_t rank) {
  return Eigen::Map<Eigen::Vector3d>(&numbers[3 * rank]);
}

}  // namespace

CoupledNewton::CoupledNewton(VolumeEnergy& volume, BoundaryEnergy& boundary, std::vector<double> coordinates,
                             const Team& team)
    : volume_(volume),
      boundary_(boundary),
      team_(team),
      reduction_(team),
      coordinates_(std::move(coordinates)),
      moves_(3 * volume.nodes().size() + 4),
      forces_(3 * volume.nodes().size() + 4) {
  for (std::vector<double>* vector : {&step_, &residual_, &direction_, &product_})
    vector->resize(3 * volume.nodes().size());
}

double CoupledNewton::energy(double delta) {
  volume_.set_delta(delta);
  const double inside = volume_.energy(coordinates_);
  return boundary_slides ? inside + boundary_.value(delta, boundary_weight).energy : inside;
}

double CoupledNewton::least() {
  volume_.set_delta(1);
  volume_.energy(coordinates_);
  return boundary_slides ? std::min(volume_.least(), boundary_.value(1, 1).least) : volume_.least();
}

void CoupledNewton::restore(const CoupledState& state) {
  coordinates_ = state.coordinates;
  boundary_.restore(state.places);
}

void CoupledNewton::put_between(const CoupledState& start, const CoupledState& end, std::span<const double> parts) {
  restore(start);
  for (const std::int32_t node : volume_.nodes())
    for (std::size_t c = 3 * at(node); c < 3 * at(node) + 3; ++c)
      coordinates_[c] += parts[at(node)] * (end.coordinates[c] - start.coordinates[c]);
  boundary_.move_between(start.places, end.places, parts, coordinates_);
  boundary_.follow();
}

void CoupledNewton::linearise(double delta, bool positive) {
  const std::size_t ranks = volume_.nodes().size();
  directions_ = boundary_.directions();
  directions_.resize(ranks, Eigen::Matrix3d::Identity());
  if (!boundary_slides)
    for (std::size_t rank = 0; rank < ranks; ++rank)
      if (boundary_.slides(volume_.nodes()[rank])) directions_[rank].setZero();
  volume_.linearise(positive, gradient_, blocks_);
  if (boundary_slides)
    boundary_hessian_ = &boundary_.linearise(delta, boundary_weight, positive, directions_, gradient_);
  team_.for_each(static_cast<std::int32_t>(ranks), kNodesPerTask, [&](std::int32_t rank) {
    const Eigen::Vector3d slope = directions_[at(rank)].transpose() * node(gradient_, at(rank));
    node(gradient_, at(rank)) = slope;
  });
  invert_blocks();
}

void CoupledNewton::invert_blocks() {
  inverse_.resize(directions_.size());
  team_.for_each(static_cast<std::int32_t>(directions_.size()), kNodesPerTask, [&](std::int32_t rank) {
    const Eigen::Matrix3d& T = directions_[at(rank)];
    Eigen::Matrix3d block = T.transpose() * full(blocks_[at(rank)]) * T;
    if (boundary_slides && boundary_.slides(volume_.nodes()[at(rank)]))
      for (int row = 0; row < 3; ++row)
        for (BoundaryEnergy::Matrix::InnerIterator entry(*boundary_hessian_, 3 * rank + row); entry; ++entry)
          if (entry.col() / 3 == rank) block(row, entry.col() % 3) += entry.value();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(block);
    const double largest = solver.eigenvalues().cwiseAbs().maxCoeff();
    Eigen::Vector3d inverse;
    for (int k = 0; k < 3; ++k) {
      const double value = std::abs(solver.eigenvalues()[k]);
      inverse[k] = largest > 0 ? 1 / std::max(value, kLeastShare * largest) : 0;
    }
    inverse_[at(rank)] = solver.eigenvectors() * inverse.asDiagonal() * solver.eigenvectors().transpose();
    // In directions in which the node does not move nothing is to be solved.
    for (int k = 0; k < 3; ++k)
      if (T.col(k).isZero(0)) {
        inverse_[at(rank)].row(k).setZero();
        inverse_[at(rank)].col(k).setZero();
      }
  });
}

// ===== The linear system =====

double CoupledNewton::dot(const std::vector<double>& a, const std::vector<double>& b) {
  return reduction_.sum(a.size(), 16384, [&](std::size_t i) { return a[i] * b[i]; });
}

double CoupledNewton::multiply() {
  const auto ranks = static_cast<std::int32_t>(directions_.size());
  team_.for_each(ranks, kNodesPerTask, [&](std::int32_t rank) {
    const Eigen::Vector3d move = directions_[at(rank)] * node(direction_, at(rank));
    for (int k = 0; k < 3; ++k) moves_[at(3 * rank + k)] = static_cast<float>(move[k]);
  });
  volume_.multiply(moves_, forces_);
  team_.for_each(ranks, kNodesPerTask, [&](std::int32_t rank) {
    Eigen::Vector3d sum =
        directions_[at(rank)].transpose() * Eigen::Map<const Eigen::Vector3f>(&forces_[3 * at(rank)]).cast<double>();
    for (int row = 0; boundary_slides && row < 3; ++row)
      for (BoundaryEnergy::Matrix::InnerIterator entry(*boundary_hessian_, 3 * rank + row); entry; ++entry)
        sum[row] += entry.value() * direction_[at(static_cast<std::int64_t>(entry.col()))];
    node(product_, at(rank)) = sum;
  });
  return dot(direction_, product_);
}

double CoupledNewton::precondition() {
  team_.for_each(static_cast<std::int32_t>(inverse_.size()), kNodesPerTask, [&](std::int32_t rank) {
    node(product_, at(rank)) = inverse_[at(rank)] * node(std::as_const(residual_), at(rank));
  });
  return dot(residual_, product_);
}

/// The vectors of conjugate gradients: x is step_, r is residual_, p is direction_; A p and then z are in product_.
struct CoupledNewton::LinearSystem {
  CoupledNewton& newton;
  double initial;

  double multiply() { return newton.multiply(); }
  void advance(double alpha) {
    newton.team_.for_ranges(newton.step_.size(), 16384, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        newton.step_[i] += alpha * newton.direction_[i];
        newton.residual_[i] -= alpha * newton.product_[i];
      }
    });
  }
  double precondition() { return newton.precondition(); }
  bool is_solved(double rz) const { return rz <= kForcing * kForcing * initial; }
  void turn(double beta) {
    newton.team_.for_ranges(newton.step_.size(), 16384, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) newton.direction_[i] = newton.product_[i] + beta * newton.direction_[i];
    });
  }
};

ConjugateGradients CoupledNewton::solve() {
  std::ranges::fill(step_, 0.0);
  std::ranges::transform(gradient_, residual_.begin(), [](double g) { return -g; });
  const double initial = precondition();
  direction_ = product_;
  LinearSystem system{*this, initial};
  const ConjugateGradients result = conjugate_gradients(system, initial, kMostProducts);
  // The quadratic model is not bounded below. The step is what was found so far, or the first direction.
  if (result.negative_curvature && result.products == 1) step_ = direction_;
  return result;
}

// ===== A step =====

double CoupledNewton::energy_at(double alpha, const CoupledState& start, double delta) {
  std::vector<double> scaled = step_;
  for (double& number : scaled) number *= alpha;
  for (std::size_t rank = 0; rank < volume_.nodes().size(); ++rank)
    if (!boundary_.slides(volume_.nodes()[rank]))
      node(coordinates_, at(volume_.nodes()[rank])) =
          node(start.coordinates, at(volume_.nodes()[rank])) + node(std::as_const(scaled), rank);
  if (boundary_slides) boundary_.move(start.places, scaled, coordinates_);
  return energy(delta);
}

CoupledNewton::Outcome CoupledNewton::step(double delta) {
  Outcome outcome;
  const double before = energy(delta);
  if (!std::isfinite(before)) return outcome;
  linearise(delta, false);
  ConjugateGradients linear = solve();
  outcome.products = linear.products;
  if (linear.negative_curvature && linear.products <= kFewProducts) {
    outcome.positive = true;
    linearise(delta, true);
    outcome.products += solve().products;
  }
  const double slope = dot(gradient_, step_);
  if (!(slope < 0)) return outcome;
  for (std::size_t rank = 0; rank < directions_.size(); ++rank) {
    const Eigen::Vector3d move = volume_.diagonal() * (directions_[rank] * node(std::as_const(step_), rank));
    node(step_, rank) = move;
  }
  const CoupledState start = state();
  const AcceptedStep accepted = backtrack({before, slope, 1e-14 * std::abs(before), kMostTrials},
                                          [&](double alpha) { return energy_at(alpha, start, delta); });
  outcome.share = accepted.alpha;
  if (accepted.alpha == 0) {
    restore(start);
    return outcome;
  }
  if (boundary_slides) boundary_.follow();
  outcome.moved = true;
  outcome.fall = (before - accepted.energy) / std::abs(before);
  return outcome;
}

}  // namespace varimesh::detail
