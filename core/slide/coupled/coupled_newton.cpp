#include "core/slide/coupled/coupled_newton.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "core/base/index.h"

namespace varimesh::detail {
namespace {

constexpr std::int32_t kNodesPerTask = 256;
constexpr std::size_t kNumbersPerTask = 16384;
constexpr int kMostProducts = 300;
constexpr int kFewProducts = 10;      // a step that meets negative curvature so soon is solved with a convex part
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

NewtonOutcome CoupledNewton::step(double delta) {
  delta_ = delta;
  NewtonRules rules;
  rules.most_products = kMostProducts;
  rules.forcing = kForcing;
  rules.few_products = kFewProducts;
  rules.most_trials = kMostTrials;
  return NewtonMethod(*this, rules).step();
}

double CoupledNewton::energy() {
  volume_.set_delta(delta_);
  const double inside = volume_.energy(coordinates_);
  return boundary_slides ? inside + boundary_.value(delta_, boundary_weight).energy : inside;
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

// ===== The linear system =====

double CoupledNewton::linearise(bool /*renews*/) {
  const std::size_t ranks = volume_.nodes().size();
  gradient_.assign(3 * ranks, 0);
  inverse_.assign(ranks, Eigen::Matrix3d::Zero());
  volume_.set_delta(delta_);
  volume_.place(coordinates_);
  volume_.cells().linearise(gradient_);
  before_ = volume_.cells().value();
  if (boundary_slides) before_ += boundary_.value(delta_, boundary_weight).energy;
  if (!std::isfinite(before_)) {
    std::ranges::fill(gradient_, 0.0);
    begin_system();
    return before_;
  }
  directions_ = boundary_.directions();
  directions_.resize(ranks, Eigen::Matrix3d::Identity());
  if (!boundary_slides)
    team_.for_each(static_cast<std::int32_t>(ranks), kNodesPerTask, [&](std::int32_t rank) {
      if (boundary_.slides(volume_.nodes()[at(rank)])) directions_[at(rank)].setZero();
    });
  if (boundary_slides) boundary_hessian_ = &boundary_.linearise(delta_, boundary_weight, false, directions_, gradient_);
  team_.for_each(static_cast<std::int32_t>(ranks), kNodesPerTask, [&](std::int32_t rank) {
    const Eigen::Vector3d slope = directions_[at(rank)].transpose() * node(gradient_, at(rank));
    node(gradient_, at(rank)) = slope;
  });
  volume_.cells().for_blocks([&](std::int32_t rank, const std::array<double, 6>& block) { invert_block(rank, block); });
  begin_system();
  return before_;
}

bool CoupledNewton::make_convex() {
  volume_.cells().keep_convex_part(material(Options{}));
  std::vector<double> unused = gradient_;
  if (boundary_slides) boundary_hessian_ = &boundary_.linearise(delta_, boundary_weight, true, directions_, unused);
  volume_.cells().for_blocks([&](std::int32_t rank, const std::array<double, 6>& block) { invert_block(rank, block); });
  begin_system();
  return true;
}

void CoupledNewton::begin_system() {
  team_.for_ranges(step_.size(), kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      step_[i] = 0;
      residual_[i] = -gradient_[i];
    }
  });
}

void CoupledNewton::invert_block(std::int32_t rank, const std::array<double, 6>& of_volume) {
  const Eigen::Matrix3d& T = directions_[at(rank)];
  Eigen::Matrix3d block = T.transpose() * full(of_volume) * T;
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
}

double CoupledNewton::dot(const std::vector<double>& a, const std::vector<double>& b) {
  return reduction_.sum(a.size(), kNumbersPerTask, [&](std::size_t i) { return a[i] * b[i]; });
}

double CoupledNewton::multiply() {
  const auto ranks = static_cast<std::int32_t>(directions_.size());
  team_.for_each(ranks, kNodesPerTask, [&](std::int32_t rank) {
    const Eigen::Vector3d move = directions_[at(rank)] * node(direction_, at(rank));
    for (int k = 0; k < 3; ++k) moves_[at(3 * rank + k)] = static_cast<float>(move[k]);
  });
  volume_.cells().multiply(moves_, forces_);
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

void CoupledNewton::advance(double alpha) {
  team_.for_ranges(step_.size(), kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      step_[i] += alpha * direction_[i];
      residual_[i] -= alpha * product_[i];
    }
  });
}

void CoupledNewton::turn(double beta) {
  team_.for_ranges(step_.size(), kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) direction_[i] = product_[i] + (beta == 0 ? 0 : beta * direction_[i]);
  });
}

double CoupledNewton::gradient_norm() { return std::sqrt(dot(gradient_, gradient_)); }

double CoupledNewton::preconditioned_norm(double rq) const { return std::sqrt(std::max(0.0, rq)); }

double CoupledNewton::largest_step() {
  return reduction_.largest(step_.size(), kNumbersPerTask, [&](std::size_t i) { return std::abs(step_[i]); });
}

// ===== The step =====

double CoupledNewton::finish_step() {
  const double slope = dot(gradient_, step_);
  team_.for_each(static_cast<std::int32_t>(directions_.size()), kNodesPerTask, [&](std::int32_t rank) {
    const Eigen::Vector3d move = volume_.diagonal() * (directions_[at(rank)] * node(std::as_const(step_), at(rank)));
    node(step_, at(rank)) = move;
  });
  start_ = state();
  return slope;
}

double CoupledNewton::move(double alpha) {
  if (alpha == 0) {
    restore(start_);
    return before_;
  }
  std::vector<double> scaled(step_.size());
  team_.for_each(static_cast<std::int32_t>(volume_.nodes().size()), kNodesPerTask, [&](std::int32_t rank) {
    node(scaled, at(rank)) = alpha * node(std::as_const(step_), at(rank));
    if (const std::int32_t moved = volume_.nodes()[at(rank)]; !boundary_.slides(moved))
      node(coordinates_, at(moved)) = node(start_.coordinates, at(moved)) + node(std::as_const(scaled), at(rank));
  });
  if (boundary_slides) boundary_.move(start_.places, scaled, coordinates_);
  return energy();
}

void CoupledNewton::settle() {
  if (boundary_slides) boundary_.follow();
}

}  // namespace varimesh::detail
