#include "core/slide/entity_newton.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/kernels/regularisation.h"
#include "core/solvers/dense_vectors.h"
#include "core/solvers/newton_method.h"

namespace varimesh::detail {
namespace {

constexpr int kMostTrials = 12;  // of a line search
/// The nodes are at the optimum if none moves by more than this, relative to the distance between nodes.
constexpr double kConverged = 1e-3;
/// Added to the Hessian's diagonal, relative to its mean: a closed surface may turn in itself at no cost.
constexpr double kShift = 1e-8;
/// Bytes of the derivatives that are kept at once, and the most elements with these.
constexpr std::size_t kBatchBytes = std::size_t{1} << 21, kMostInBatch = 256;

template <int d>
class EntityNewton final : private DenseVectors {
 public:
  EntityNewton(EntityForm<d> form, const Team& team) : form_(std::move(form)), team_(team) {}

  EntitySlide run(std::vector<EntityNode> nodes, int most_iterations) {
    form_.set_nodes(std::move(nodes));
    form_.leave_out_constant_points();
    number_unknowns();
    if (most_iterations > 0 && unknowns_ > 0) prepare_hessian();
    const std::vector<EntityNode> start = form_.nodes();
    EntitySlide result;
    result.folded_before = form_.folded(team_);
    iterate(kDeltaFalls, most_iterations, result);
    if (most_iterations > 0 && !(least_ > 0)) iterate(kDeltaFallsSlowly, 2 * most_iterations, result);
    result.folded_after = form_.folded(team_);
    for (std::size_t i = 0; i < start.size(); ++i)
      result.farthest = std::max(result.farthest, (form_.nodes()[i].x - start[i].x).norm() / form_.spacing(i));
    result.nodes = form_.take_nodes();
    return result;
  }

 private:
  /// Steps until the nodes move no more. While least_ ≤ 0, all elements have the same δ.
  void iterate(double decay, int most_iterations, EntitySlide& result) {
    NewtonRules rules;
    rules.most_trials = kMostTrials;
    rules.decrease = 0;  // any decrease will do; see move()
    NewtonMethod method(*this, rules);
    for (int step = 0; step < most_iterations && unknowns_ > 0; ++step) {
      team_.look();
      delta_ = least_ > 0 ? 0 : falling_delta(step, decay);
      moved_ = 0;
      method.step();
      ++result.iterations;
      if (moved_ < kConverged && (delta_ == 0 || step > most_iterations / 2)) break;
      if (!has_factors_) break;
    }
  }

  void number_unknowns() {
    // A node without a normal is at a pole, where a step in the parameters leads nowhere.
    first_.assign(form_.nodes().size(), -1);
    for (std::size_t i = 0; i < first_.size(); ++i) {
      if (!form_.nodes()[i].free || form_.is_at_pole(i)) continue;
      first_[i] = unknowns_;
      unknowns_ += d;
    }
    least_ = form_.total(0, team_).least_movable;
  }

  /// Calls visit(element, a, b, row, column) for each pair of an element's free nodes a and b whose block lies in the
  /// Hessian's lower triangle, with the first unknowns of both. `before(element)` comes before the pairs of an element.
  template <class Before, class Visit>
  void for_blocks(const Before& before, const Visit& visit) const {
    for (std::size_t e = 0; e < form_.size(); ++e) {
      before(e);
      const std::vector<std::int32_t>& places = form_.places(e);
      for (std::size_t a = 0; a < places.size(); ++a)
        for (std::size_t b = 0; b < places.size(); ++b) {
          const Eigen::Index row = first_[static_cast<std::size_t>(places[a])];
          const Eigen::Index column = first_[static_cast<std::size_t>(places[b])];
          if (column >= 0 && column <= row) visit(e, a, b, row, column);
        }
    }
  }

  /// Sets the entries of the Hessian that all steps have, where each block of an element begins in its columns, and the
  /// order of elimination.
  void prepare_hessian() {
    const auto nothing = [](std::size_t) {};
    std::vector<Eigen::Triplet<double>> entries;
    for (Eigen::Index k = 0; k < unknowns_; ++k) entries.emplace_back(k, k, 0);
    for_blocks(nothing, [&](std::size_t, std::size_t, std::size_t, Eigen::Index row, Eigen::Index column) {
      for (int c = 0; c < d; ++c)
        for (int r = row == column ? c : 0; r < d; ++r) entries.emplace_back(row + r, column + c, 0);
    });
    hessian_.resize(unknowns_, unknowns_);
    hessian_.setFromTriplets(entries.begin(), entries.end());
    for_blocks(nothing, [&](std::size_t, std::size_t, std::size_t, Eigen::Index row, Eigen::Index column) {
      auto& begins = slots_.emplace_back();
      for (int c = 0; c < d; ++c) {
        const int* const rows = hessian_.innerIndexPtr();
        const int *const begin = rows + hessian_.outerIndexPtr()[column + c],
                         *const end = rows + hessian_.outerIndexPtr()[column + c + 1];
        begins[static_cast<std::size_t>(c)] =
            std::lower_bound(begin, end, static_cast<int>(std::max(row, column + c))) - rows;
      }
    });
    factors_.analyzePattern(hessian_);
  }

  // ===== One step =====

  double linearise(bool /*renews*/) override {
    tangents_.assign(form_.nodes().size(), Eigen::Matrix<double, 3, d>::Zero());
    for (std::size_t i = 0; i < tangents_.size(); ++i)
      if (first_[i] >= 0) tangents_[i] = form_.tangents(i);
    if (value_delta_ != delta_) take_value();
    assemble();
    const double mean = hessian_.diagonal().sum() / static_cast<double>(unknowns_);
    for (Eigen::Index k = 0; k < unknowns_; ++k) hessian_.valuePtr()[hessian_.outerIndexPtr()[k]] += kShift * mean;
    factors_.factorize(hessian_);
    has_factors_ = factors_.info() == Eigen::Success;
    if (!has_factors_) slope_.setZero();
    start(slope_);
    start_ = form_.nodes();
    return value_.energy;
  }
  /// M is H, so its solution is the step.
  double precondition() override {
    product_ = has_factors_ ? Eigen::VectorXd(factors_.solve(residual_)) : residual_;
    return residual_.dot(product_);
  }
  double multiply() override {
    product_ = hessian_.template selfadjointView<Eigen::Lower>() * direction_;
    return direction_.dot(product_);
  }
  double gradient_norm() override { return slope_.norm(); }
  double largest_step() override {
    double largest = 0;
    for (std::size_t i = 0; i < first_.size(); ++i)
      if (first_[i] >= 0) largest = std::max(largest, step_.segment<d>(first_[i]).norm() / form_.spacing(i));
    return largest;
  }
  /// No node moves by more than half the distance between nodes.
  double finish_step() override {
    wish_.assign(first_.size(), Eigen::Vector3d::Zero());
    for (std::size_t i = 0; i < first_.size(); ++i) {
      if (first_[i] < 0) continue;
      auto own = step_.segment<d>(first_[i]);
      wish_[i] = tangents_[i] * own;
      const double most = 0.5 * form_.spacing(i), share = most / wish_[i].norm();
      if (!(share < 1)) continue;
      wish_[i] *= share;
      own *= share;
    }
    return slope_.dot(step_);
  }
  double move(double alpha) override {
    std::vector<EntityNode>& nodes = form_.nodes();
    moved_ = 0;
    if (alpha == 0) {
      nodes = start_;
      return value_.energy;
    }
    for (std::size_t i = 0; i < first_.size(); ++i) {
      if (first_[i] < 0) continue;
      nodes[i] = form_.moved(start_[i], i, alpha * wish_[i]);
      moved_ = std::max(moved_, (nodes[i].x - start_[i].x).norm() / form_.spacing(i));
    }
    // A step that leaves the energy as it is leaves the nodes as they are.
    const double energy = form_.total(delta_, team_).energy;
    return std::isfinite(moved_) && energy < value_.energy ? energy : std::numeric_limits<double>::infinity();
  }
  void settle() override {
    form_.take_normals();
    take_value();
    least_ = value_.least_movable;
  }
  void take_value() {
    value_ = form_.total(delta_, team_);
    value_delta_ = delta_;
  }

  /// The derivatives of one element by its nodes' places on their tangents, d per node.
  struct Derivatives {
    Eigen::VectorXd gradient;
    Eigen::MatrixXd hessian;
  };

  Derivatives derivatives(std::size_t e) const {
    Eigen::VectorXd gradient;
    Eigen::MatrixXd hessian;
    form_.derivatives(e, delta_, gradient, hessian);
    const std::vector<std::int32_t>& places = form_.places(e);
    const auto nodes = static_cast<Eigen::Index>(places.size());
    Derivatives on_tangents{Eigen::VectorXd(d * nodes), Eigen::MatrixXd(d * nodes, d * nodes)};
    const auto tangents = [&](Eigen::Index node) -> const Eigen::Matrix<double, 3, d>& {
      return tangents_[static_cast<std::size_t>(places[static_cast<std::size_t>(node)])];
    };
    for (Eigen::Index b = 0; b < nodes; ++b) {
      on_tangents.gradient.template segment<d>(d * b) = tangents(b).transpose() * gradient.segment<3>(3 * b);
      for (Eigen::Index a = b; a < nodes; ++a) {
        const Eigen::Matrix<double, d, d> block =
            tangents(a).transpose() * hessian.block<3, 3>(3 * a, 3 * b) * tangents(b);
        on_tangents.hessian.template block<d, d>(d * a, d * b) = block;
        on_tangents.hessian.template block<d, d>(d * b, d * a) = block.transpose();
      }
    }
    return on_tangents;
  }

  /// Elements whose derivatives are kept at once. The result does not depend on it.
  std::size_t batch_size() const {
    std::size_t most = 1;
    for (std::size_t e = 0; e < form_.size(); ++e) most = std::max(most, d * form_.places(e).size());
    const std::size_t fit = kBatchBytes / (most * most * sizeof(double));
    return std::clamp(fit, static_cast<std::size_t>(EntityForm<d>::kGrain), kMostInBatch);
  }

  /// Sets the gradient and the Hessian by the unknowns. The threads share the derivatives of the elements, and one adds
  /// them up in the order of the elements.
  void assemble() {
    slope_.setZero(unknowns_);
    std::fill_n(hessian_.valuePtr(), hessian_.nonZeros(), 0.0);
    std::vector<Derivatives> batch(batch_size());
    const auto begin_element = [&](std::size_t e) {
      if (e % batch.size() == 0)
        team_.for_each(
            static_cast<std::int32_t>(std::min(batch.size(), form_.size() - e)), EntityForm<d>::kGrain,
            [&](std::int32_t i) { batch[static_cast<std::size_t>(i)] = derivatives(e + static_cast<std::size_t>(i)); });
      const std::vector<std::int32_t>& places = form_.places(e);
      for (std::size_t a = 0; a < places.size(); ++a)
        if (const Eigen::Index first = first_[static_cast<std::size_t>(places[a])]; first >= 0)
          slope_.segment<d>(first) +=
              batch[e % batch.size()].gradient.template segment<d>(static_cast<Eigen::Index>(d * a));
    };
    auto slot = slots_.begin();
    for_blocks(begin_element, [&](std::size_t e, std::size_t a, std::size_t b, Eigen::Index row, Eigen::Index column) {
      const auto block = batch[e % batch.size()].hessian.template block<d, d>(static_cast<Eigen::Index>(d * a),
                                                                              static_cast<Eigen::Index>(d * b));
      for (int c = 0; c < d; ++c) {
        double* value = hessian_.valuePtr() + (*slot)[static_cast<std::size_t>(c)];
        for (int r = row == column ? c : 0; r < d; ++r) *value++ += block(r, c);
      }
      ++slot;
    });
  }

  EntityForm<d> form_;
  const Team& team_;
  std::vector<Eigen::Index> first_;  ///< By node: its first unknown; −1 if it is held.
  Eigen::Index unknowns_ = 0;
  std::vector<Eigen::Matrix<double, 3, d>> tangents_;  ///< By node.
  Eigen::VectorXd slope_;                              ///< The gradient by the unknowns.
  Eigen::SparseMatrix<double> hessian_;                ///< Its lower triangle.
  std::vector<std::array<std::ptrdiff_t, d>> slots_;   ///< By pair of for_blocks() and column of its block.
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower> factors_;
  bool has_factors_ = true;            ///< The last Hessian could be factorised.
  std::vector<Eigen::Vector3d> wish_;  ///< By node: the displacement of the whole step.
  std::vector<EntityNode> start_;      ///< Where the step found the nodes.
  double delta_ = 0;
  double moved_ = 0;                     ///< The largest movement of a node over the distance between nodes there.
  double least_ = 0;                     ///< Smallest J of all points that free nodes change.
  typename EntityForm<d>::Value value_;  ///< With value_delta_, where the nodes are.
  double value_delta_ = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace

EntitySlide slide_on_curve(int curve, const std::vector<EntityElement>& elements, int order,
                           const Association& association, const std::vector<double>& at_start,
                           std::vector<EntityNode> nodes, int most_iterations, const Team& team) {
  return EntityNewton<1>(EntityForm<1>(association, curve, elements, order, at_start), team)
      .run(std::move(nodes), most_iterations);
}

EntitySlide slide_on_surface(int surface, const std::vector<EntityElement>& elements, int order,
                             const Association& association, const std::vector<double>& at_start,
                             std::vector<EntityNode> nodes, int most_iterations, const Team& team) {
  return EntityNewton<2>(EntityForm<2>(association, surface, elements, order, at_start), team)
      .run(std::move(nodes), most_iterations);
}

}  // namespace varimesh::detail
