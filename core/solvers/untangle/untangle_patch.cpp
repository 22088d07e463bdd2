// Newton steps with a positive semidefinite Hessian, conjugate gradients preconditioned by the nodes' blocks, and the
// schedule of ε.
#include "core/solvers/untangle/untangle_patch.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <unordered_map>
#include <utility>

#include "core/base/index.h"
#include "core/kernels/regularisation.h"
#include "core/solvers/dense_vectors.h"
#include "core/solvers/newton_method.h"

namespace varimesh {
namespace {

constexpr int kNewtonSteps = 3;  // for each ε
constexpr int kMostProducts = 60;
constexpr double kForcing = 0.1;  // share of the initial residual to which conjugate gradients solve
constexpr int kMostTrials = 31;   // of a line search, before any doubling
constexpr int kMostDoublings = 4;
constexpr double kSmallDecrease = 1e-4;  // relative: after a smaller one no further step is taken at this ε
constexpr std::int32_t kCellsPerTask = 4;

using Block = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>;

/// The inverse of a node's block, which is positive definite except for rounding.
Block inverse(const Block& block) {
  const double floor = 1e-12 * block.trace() + std::numeric_limits<double>::min();
  const Block identity = Block::Identity(block.rows(), block.cols());
  return (block + floor * identity).llt().solve(identity);
}

}  // namespace

UntanglePatch::UntanglePatch(const std::vector<CoefficientEnergy>& energies, std::vector<Member> members,
                             std::vector<std::int32_t> nodes, int dimension, const StopToken* stop)
    : energies_(energies), members_(std::move(members)), nodes_(std::move(nodes)), dimension_(dimension) {
  positions_.resize(static_cast<Eigen::Index>(nodes_.size()) * dimension);
  for (const Member& member : members_)
    for (std::size_t i = 0; i < member.unknown.size(); ++i)
      positions_.segment(member.unknown[i] * dimension, dimension) = member.cell.positions.row(member.cell.free[i]);
  for (Member& member : members_) energies_[at(member.set)].find_movable(member.cell, stop);
  measure_coefficients(stop);
  epsilon_ = first_epsilon(smallest_);
}

bool UntanglePatch::gather(const Problem& problem) {
  const std::size_t d = at(dimension_);
  std::unordered_map<std::int32_t, std::int32_t> unknown_of;
  positions_.resize(static_cast<Eigen::Index>(nodes_.size()) * dimension_);
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    if (nodes_[n] < 0 || at(nodes_[n]) >= problem.positions.size() / d) return false;
    unknown_of[nodes_[n]] = static_cast<std::int32_t>(n);
    for (std::size_t k = 0; k < d; ++k)
      positions_[static_cast<Eigen::Index>(n * d + k)] = problem.positions[at(nodes_[n]) * d + k];
  }
  for (Member& member : members_) {
    if (member.set < 0 || at(member.set) >= problem.sets.size()) return false;
    const CellSet& set = problem.sets[at(member.set)];
    if (member.cell.number < 0 || member.cell.number >= set.count) return false;
    member.cell.positions.resize(set.nodes_per_cell, dimension_);
    for (int n = 0; n < set.nodes_per_cell; ++n) {
      const std::int32_t node = set.nodes[at(member.cell.number) * at(set.nodes_per_cell) + at(n)];
      for (int k = 0; k < dimension_; ++k) member.cell.positions(n, k) = problem.positions[at(node) * d + at(k)];
      const auto unknown = unknown_of.find(node);
      if (unknown == unknown_of.end()) continue;
      member.cell.free.push_back(n);
      member.unknown.push_back(unknown->second);
    }
  }
  find_lengths(problem);
  return true;
}

void UntanglePatch::find_lengths(const Problem& problem) {
  lengths_.assign(nodes_.size(), std::numeric_limits<double>::infinity());
  for (const Member& member : members_) {
    const double size = problem.cell_size[at(problem.sets[at(member.set)].first + member.cell.number)];
    for (const std::int32_t unknown : member.unknown) lengths_[at(unknown)] = std::min(lengths_[at(unknown)], size);
  }
}

void UntanglePatch::place(const Eigen::VectorXd& positions) {
  for (Member& member : members_)
    for (std::size_t i = 0; i < member.unknown.size(); ++i)
      member.cell.positions.row(member.cell.free[i]) = positions.segment(member.unknown[i] * dimension_, dimension_);
}

double UntanglePatch::value(const Team& team) const {
  std::vector<double> values(members_.size());
  team.for_each(static_cast<std::int32_t>(members_.size()), kCellsPerTask, [&](std::int32_t i) {
    values[at(i)] = energies_[at(members_[at(i)].set)].value(members_[at(i)].cell, epsilon_);
  });
  double sum = 0;
  for (const double value : values) sum += value;
  return std::isfinite(sum) ? sum : std::numeric_limits<double>::infinity();
}

double UntanglePatch::expand(const Team& team, HessianRoom& room) {
  forget_hessians(room);
  expansions_.resize(members_.size());
  blocks_.resize(members_.size());
  std::atomic<std::int64_t> taken = 0;
  team.for_each(static_cast<std::int32_t>(members_.size()), 1, [&](std::int32_t i) {
    expansions_[at(i)] = energies_[at(members_[at(i)].set)].expand(members_[at(i)].cell, epsilon_, team.stop());
    Eigen::MatrixXd& hessian = expansions_[at(i)].hessian;
    blocks_[at(i)].resize(dimension_, hessian.cols());
    for (Eigen::Index n = 0; n < hessian.cols(); n += dimension_)
      blocks_[at(i)].middleCols(n, dimension_) = hessian.block(n, n, dimension_, dimension_);
    const auto bytes = static_cast<std::int64_t>(sizeof(double)) * hessian.size();
    if (room.take(bytes))
      taken += bytes;
    else
      hessian.resize(0, 0);
  });
  taken_ = taken;
  double sum = 0;
  gradient_.setZero(positions_.size());
  for (std::size_t i = 0; i < members_.size(); ++i) {
    sum += expansions_[i].value;
    for (std::size_t n = 0; n < members_[i].unknown.size(); ++n)
      gradient_.segment(members_[i].unknown[n] * dimension_, dimension_) +=
          expansions_[i].gradient.segment(static_cast<Eigen::Index>(n) * dimension_, dimension_);
  }
  return sum;
}

std::int64_t UntanglePatch::hessian_bytes() const {
  std::int64_t entries = 0;
  for (const Member& member : members_) {
    const auto unknowns = static_cast<std::int64_t>(member.unknown.size()) * dimension_;
    entries += unknowns * unknowns;
  }
  return static_cast<std::int64_t>(sizeof(double)) * entries;
}

void UntanglePatch::forget_hessians(HessianRoom& room) {
  expansions_.clear();
  blocks_.clear();
  room.give_back(std::exchange(taken_, 0));
}

Eigen::VectorXd UntanglePatch::multiply(const Eigen::VectorXd& x, const Team& team) const {
  std::vector<Eigen::VectorXd> products(members_.size());
  team.for_each(static_cast<std::int32_t>(members_.size()), kCellsPerTask, [&](std::int32_t i) {
    const std::vector<std::int32_t>& unknown = members_[at(i)].unknown;
    Eigen::VectorXd own(static_cast<Eigen::Index>(unknown.size()) * dimension_);
    for (std::size_t n = 0; n < unknown.size(); ++n)
      own.segment(static_cast<Eigen::Index>(n) * dimension_, dimension_) =
          x.segment(unknown[n] * dimension_, dimension_);
    const Member& member = members_[at(i)];
    if (expansions_[at(i)].hessian.size() > 0)
      products[at(i)].noalias() = expansions_[at(i)].hessian * own;
    else
      products[at(i)].noalias() = energies_[at(member.set)].expand(member.cell, epsilon_, team.stop()).hessian * own;
  });
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(x.size());
  for (std::size_t i = 0; i < members_.size(); ++i)
    for (std::size_t n = 0; n < members_[i].unknown.size(); ++n)
      sum.segment(members_[i].unknown[n] * dimension_, dimension_) +=
          products[i].segment(static_cast<Eigen::Index>(n) * dimension_, dimension_);
  return sum;
}

/// The energy of the patch at its ε for Newton's method. The Hessian is positive semidefinite; the preconditioner has
/// the inverses of the nodes' blocks.
class UntanglePatch::Objective final : public DenseVectors {
 public:
  Objective(UntanglePatch& patch, const Team& team, HessianRoom& room) : patch_(patch), team_(team), room_(room) {}

  double linearise(bool /*renews*/) override {
    const double energy = patch_.expand(team_, room_);
    const Eigen::Index d = patch_.dimension_;
    inverse_blocks_.assign(patch_.nodes_.size(), Block::Zero(d, d));
    for (std::size_t i = 0; i < patch_.members_.size(); ++i)
      for (std::size_t n = 0; n < patch_.members_[i].unknown.size(); ++n)
        inverse_blocks_[at(patch_.members_[i].unknown[n])] +=
            patch_.blocks_[i].middleCols(static_cast<Eigen::Index>(n) * d, d);
    for (Block& block : inverse_blocks_) block = inverse(block);
    start_ = patch_.positions_;
    start(patch_.gradient_);
    return energy;
  }
  double precondition() override {
    Eigen::Index first = 0;
    for (const Block& block : inverse_blocks_) {
      product_.segment(first, block.rows()).noalias() = block * residual_.segment(first, block.rows());
      first += block.rows();
    }
    return residual_.dot(product_);
  }
  double multiply() override {
    product_ = patch_.multiply(direction_, team_);
    return direction_.dot(product_);
  }
  double gradient_norm() override { return patch_.gradient_.norm(); }
  double largest_step() override {
    double largest = 0;
    const Eigen::Index d = patch_.dimension_;
    for (std::size_t n = 0; n < patch_.nodes_.size(); ++n)
      largest = std::max(largest, step_.segment(static_cast<Eigen::Index>(n) * d, d).norm() /
                                      (patch_.lengths_.empty() ? 1 : patch_.lengths_[n]));
    return largest;
  }
  double finish_step() override { return patch_.gradient_.dot(step_); }
  double move(double alpha) override {
    patch_.positions_ = start_ + alpha * step_;
    patch_.place(patch_.positions_);
    return patch_.value(team_);
  }

 private:
  UntanglePatch& patch_;
  const Team& team_;
  HessianRoom& room_;
  std::vector<Block> inverse_blocks_;  ///< By node.
  Eigen::VectorXd start_;              ///< The positions where linearise() found them.
};

UntangleStep UntanglePatch::step(const Team& team, HessianRoom& room) {
  NewtonRules rules;
  rules.most_products = kMostProducts;
  rules.forcing = kForcing;
  rules.most_trials = kMostTrials;
  rules.most_doublings = kMostDoublings;
  Objective objective(*this, team, room);
  NewtonMethod method(objective, rules);
  UntangleStep outcome;
  double before = 0;
  for (int number = 0; number < kNewtonSteps; ++number) {
    const NewtonOutcome newton = method.step();
    if (number == 0) {
      before = newton.before;
      outcome.gradient_norm = newton.gradient_norm;
    }
    outcome.residual = std::max(outcome.residual, newton.residual);
    if (newton.damping == 0 || newton.after > (1 - kSmallDecrease) * newton.before) break;
  }
  forget_hessians(room);
  measure_coefficients(team.stop());
  epsilon_ = next_epsilon(smallest_, regularised_jacobian(smallest_, epsilon_), before, value(team));
  return outcome;
}

void UntanglePatch::measure_coefficients(const StopToken* stop) {
  smallest_ = std::numeric_limits<double>::infinity();
  bad_ = 0;
  for (const Member& member : members_) {
    look(stop);
    const double least = energies_[at(member.set)].smallest_coefficient(member.cell);
    smallest_ = std::min(smallest_, least);
    bad_ += least > 0 ? 0 : 1;
  }
}

}  // namespace varimesh
