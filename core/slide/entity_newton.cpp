#include "core/slide/entity_newton.h"

#include <Eigen/SparseCholesky>
#include <cmath>
#include <limits>

namespace varimesh::detail {
namespace {

constexpr int kMostHalvings = 12;
/// The nodes are at the optimum if none moves by more than this, relative to the distance between nodes.
constexpr double kConverged = 1e-3;
/// How fast δ falls while an element is folded, and how fast in a second attempt: a fold that stays while δ falls fast
/// may open while it falls slowly.
constexpr double kDecay = 0.85, kSlowDecay = 0.9;
/// Added to the Hessian's diagonal, relative to its mean: a closed surface may turn in itself at no cost.
constexpr double kShift = 1e-8;

template <int d>
class EntityNewton {
 public:
  EntityNewton(EntityForm<d> form, const StopToken* stop) : form_(std::move(form)), stop_(stop) {}

  EntitySlide run(std::vector<EntityNode> nodes, int most_iterations) {
    form_.set_nodes(std::move(nodes));
    number_unknowns();
    const std::vector<EntityNode> start = form_.nodes();
    EntitySlide result;
    result.folded_before = form_.folded();
    iterate(kDecay, most_iterations, result);
    if (most_iterations > 0 && !(least_ > 0)) iterate(kSlowDecay, 2 * most_iterations, result);
    result.folded_after = form_.folded();
    for (std::size_t i = 0; i < start.size(); ++i)
      result.farthest = std::max(result.farthest, (form_.nodes()[i].x - start[i].x).norm() / form_.spacing(i));
    result.nodes = form_.take_nodes();
    return result;
  }

 private:
  /// Steps until the nodes move no more. While an element is folded, all have the same δ = 0.5 · decay^k in step k.
  void iterate(double decay, int most_iterations, EntitySlide& result) {
    for (int step = 0; step < most_iterations && unknowns_ > 0; ++step) {
      look(stop_);
      const double delta = least_ > 0 ? 0 : 0.5 * std::pow(decay, step);
      const double moved = iterate(delta);
      ++result.iterations;
      if (moved < kConverged && (delta == 0 || step > most_iterations / 2)) break;
      if (!std::isfinite(moved)) break;
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
    least_ = form_.total(0).least;
  }

  /// One step. Returns the largest movement relative to the distance between nodes; not finite if nothing can be
  /// solved.
  double iterate(double delta) {
    std::vector<Eigen::Matrix<double, 3, d>> tangents(form_.nodes().size());
    for (std::size_t i = 0; i < tangents.size(); ++i)
      if (first_[i] >= 0) tangents[i] = form_.tangents(i);
    Eigen::VectorXd slope = Eigen::VectorXd::Zero(unknowns_);
    std::vector<Eigen::Triplet<double>> entries;
    assemble(delta, tangents, slope, entries);
    Eigen::SparseMatrix<double> H(unknowns_, unknowns_);
    H.setFromTriplets(entries.begin(), entries.end());
    const double mean = H.diagonal().sum() / static_cast<double>(unknowns_);
    for (Eigen::Index k = 0; k < unknowns_; ++k) H.coeffRef(k, k) += kShift * mean;
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower> factors(H);
    if (factors.info() != Eigen::Success) return std::numeric_limits<double>::quiet_NaN();
    const Eigen::VectorXd step = factors.solve(-slope);
    std::vector<Eigen::Vector3d> wish(tangents.size(), Eigen::Vector3d::Zero());
    for (std::size_t i = 0; i < first_.size(); ++i) {
      if (first_[i] < 0) continue;
      wish[i] = tangents[i] * step.segment<d>(first_[i]);
      const double most = 0.5 * form_.spacing(i);
      if (wish[i].norm() > most) wish[i] *= most / wish[i].norm();
    }
    return search(delta, wish);
  }

  void assemble(double delta, const std::vector<Eigen::Matrix<double, 3, d>>& tangents, Eigen::VectorXd& slope,
                std::vector<Eigen::Triplet<double>>& entries) const {
    Eigen::VectorXd gradient;
    Eigen::MatrixXd hessian;
    for (std::size_t e = 0; e < form_.size(); ++e) {
      const std::vector<std::int32_t>& places = form_.places(e);
      form_.derivatives(e, delta, gradient, hessian);
      for (std::size_t a = 0; a < places.size(); ++a) {
        const auto i = static_cast<std::size_t>(places[a]);
        if (first_[i] < 0) continue;
        slope.segment<d>(first_[i]) += tangents[i].transpose() * gradient.segment<3>(static_cast<Eigen::Index>(3 * a));
        for (std::size_t b = 0; b < places.size(); ++b) {
          const auto j = static_cast<std::size_t>(places[b]);
          if (first_[j] < 0 || first_[j] > first_[i]) continue;
          const Eigen::Matrix<double, d, d> block =
              tangents[i].transpose() *
              hessian.block<3, 3>(static_cast<Eigen::Index>(3 * a), static_cast<Eigen::Index>(3 * b)) * tangents[j];
          for (int r = 0; r < d; ++r)
            for (int c = 0; c < d; ++c)
              if (first_[j] + c <= first_[i] + r) entries.emplace_back(first_[i] + r, first_[j] + c, block(r, c));
        }
      }
    }
  }

  /// Halves the step until the energy falls. Keeps the nodes if it never does.
  double search(double delta, const std::vector<Eigen::Vector3d>& wish) {
    std::vector<EntityNode>& nodes = form_.nodes();
    const std::vector<EntityNode> before = nodes;
    const double energy = form_.total(delta).energy;
    double length = 1;
    for (int half = 0; half < kMostHalvings; ++half, length /= 2) {
      double largest = 0;
      for (std::size_t i = 0; i < first_.size(); ++i) {
        if (first_[i] < 0) continue;
        nodes[i] = form_.moved(before[i], i, length * wish[i]);
        largest = std::max(largest, (nodes[i].x - before[i].x).norm() / form_.spacing(i));
      }
      const auto value = form_.total(delta);
      if (!(value.energy < energy) || !std::isfinite(largest)) continue;
      form_.take_normals();
      least_ = form_.total(delta == 0 ? 1 : delta).least;
      return largest;
    }
    nodes = before;
    return 0;
  }

  EntityForm<d> form_;
  const StopToken* stop_;
  std::vector<Eigen::Index> first_;  ///< By node: its first unknown; −1 if it is held.
  Eigen::Index unknowns_ = 0;
  double least_ = 0;  ///< Smallest J of all elements.
};

}  // namespace

EntitySlide slide_on_curve(int curve, const std::vector<EntityElement>& elements, int order,
                           const Association& association, const std::vector<double>& at_start,
                           std::vector<EntityNode> nodes, int most_iterations, const StopToken* stop) {
  return EntityNewton<1>(EntityForm<1>(association, curve, elements, order, at_start), stop)
      .run(std::move(nodes), most_iterations);
}

EntitySlide slide_on_surface(int surface, const std::vector<EntityElement>& elements, int order,
                             const Association& association, const std::vector<double>& at_start,
                             std::vector<EntityNode> nodes, int most_iterations, const StopToken* stop) {
  return EntityNewton<2>(EntityForm<2>(association, surface, elements, order, at_start), stop)
      .run(std::move(nodes), most_iterations);
}

}  // namespace varimesh::detail
