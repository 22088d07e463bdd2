#include "core/slide/entity_newton.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/geometry/closest_point.h"
#include "core/slide/entity_energy.h"

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

// ===== The two kinds of entity =====

struct Tangents {
  Eigen::Matrix<double, 3, Eigen::Dynamic> S;  ///< First derivatives, 3 × d.
  Eigen::Vector3d x, normal;                   ///< Point; unit normal, for a curve the unit tangent.
};

template <int d>
class Entity;

template <>
class Entity<1> {
 public:
  Entity(const Association& association, int curve)
      : shape_(*association.geometry.curves[static_cast<std::size_t>(curve)].shape) {}
  Tangents at(const std::array<double, 2>& at) const {
    const geometry::CurvePoint p = shape_.at(at[0]);
    return {p.dt, p.x, p.dt.normalized()};
  }
  bool steps_in_parameters() const { return true; }
  std::array<double, 2> clamp(const std::array<double, 2>& at) const { return {shape_.range().clamp(at[0]), 0}; }
  std::array<double, 2> closest(const Eigen::Vector3d& x, const std::array<double, 2>& guess) const {
    return {geometry::closest_from(shape_, x, guess[0]).t, 0};
  }

 private:
  const geometry::CurveShape& shape_;
};

template <>
class Entity<2> {
 public:
  Entity(const Association& association, int surface)
      : shape_(*association.geometry.surfaces[static_cast<std::size_t>(surface)].shape) {}
  Tangents at(const std::array<double, 2>& at) const {
    const geometry::SurfacePoint p = shape_.at(at[0], at[1]);
    Eigen::Matrix<double, 3, 2> S;
    S << p.du, p.dv;
    return {S, p.x, shape_.normal(p, at[0], at[1])};
  }
  bool steps_in_parameters() const { return shape_.pieces() == nullptr; }
  std::array<double, 2> clamp(const std::array<double, 2>& at) const {
    return {shape_.u_range().clamp(at[0]), shape_.v_range().clamp(at[1])};
  }
  std::array<double, 2> closest(const Eigen::Vector3d& x, const std::array<double, 2>& guess) const {
    geometry::SurfaceFoot foot = geometry::closest_from(shape_, x, guess[0], guess[1]);
    // Where a piece is folded over, the way from the guess may end at the fold.
    const geometry::PieceSearch* pieces = shape_.pieces();
    if (pieces != nullptr && pieces->may_fold() && foot.distance > 0.3 * (shape_.at(guess[0], guess[1]).x - x).norm())
      foot = pieces->closest(x);
    return {foot.u, foot.v};
  }

 private:
  const geometry::SurfaceShape& shape_;
};

// ===== Newton's method =====

template <int d>
class EntityNewton {
 public:
  EntityNewton(const Entity<d>& entity, const std::vector<EntityElement>& elements, int order,
               const std::vector<double>& at_start, const StopToken* stop)
      : entity_(entity), elements_(elements), energy_(elements, order, at_start), stop_(stop) {}

  EntitySlide run(std::vector<EntityNode> nodes, int most_iterations) {
    nodes_ = std::move(nodes);
    prepare();
    const std::vector<EntityNode> start = nodes_;
    EntitySlide result;
    result.folded_before = folded();
    iterate(kDecay, most_iterations, result);
    if (most_iterations > 0 && !(least_ > 0)) iterate(kSlowDecay, 2 * most_iterations, result);
    result.folded_after = folded();
    for (std::size_t i = 0; i < nodes_.size(); ++i)
      result.farthest = std::max(result.farthest, (nodes_[i].x - start[i].x).norm() / spacing_[i]);
    result.nodes = std::move(nodes_);
    return result;
  }

 private:
  using Vectors = typename EntityEnergy<d>::Vectors;

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

  void prepare() {
    local_.resize(elements_.size());
    spacing_.assign(nodes_.size(), std::numeric_limits<double>::infinity());
    for (std::size_t e = 0; e < elements_.size(); ++e)
      for (const std::int32_t node : elements_[e].nodes) {
        const auto place = std::ranges::lower_bound(nodes_, node, {}, &EntityNode::node) - nodes_.begin();
        local_[e].push_back(static_cast<std::int32_t>(place));
        double& spacing = spacing_[static_cast<std::size_t>(place)];
        spacing = std::min(spacing, energy_.spacing(e));
      }
    sign_.assign(elements_.size(), 1);
    take_normals();
    orient();
    // A node without a normal is at a pole, where a step in the parameters leads nowhere.
    first_.assign(nodes_.size(), -1);
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      if (!nodes_[i].free || at_pole_[i]) continue;
      first_[i] = unknowns_;
      unknowns_ += d;
    }
    least_ = total(0).least;
  }

  /// Normals and tangent bases where the nodes are. At a pole the normal is the sum of those of the nodes around.
  void take_normals() {
    normals_.setZero(3, static_cast<Eigen::Index>(nodes_.size()));
    at_pole_.assign(nodes_.size(), false);
    S_.resize(nodes_.size());
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      const Tangents here = entity_.at(nodes_[i].at);
      normals_.col(static_cast<Eigen::Index>(i)) = here.normal;
      S_[i] = here.S;
      at_pole_[i] = !(here.normal.norm() > 0.5);
    }
    Vectors sums = Vectors::Zero(3, normals_.cols());
    for (const auto& element : local_)
      for (const std::int32_t pole : element)
        if (at_pole_[static_cast<std::size_t>(pole)])
          for (const std::int32_t node : element)
            if (!at_pole_[static_cast<std::size_t>(node)]) sums.col(pole) += normals_.col(node);
    for (std::size_t i = 0; i < nodes_.size(); ++i)
      if (at_pole_[i]) {
        const auto column = static_cast<Eigen::Index>(i);
        normals_.col(column) =
            sums.col(column).norm() > 0 ? Eigen::Vector3d(sums.col(column).normalized()) : Eigen::Vector3d::Zero();
      }
  }

  /// The sign of each element's J: a curve's edges may run either way, and a surface's elements all have the sense that
  /// most of those with the same number of their sense have.
  void orient() {
    std::map<int, std::int64_t> with;
    for (std::size_t e = 0; e < elements_.size(); ++e) {
      sign_[e] = mean_sign(e);
      with[elements_[e].sense] += sign_[e] > 0 ? 1 : -1;
    }
    for (std::size_t e = 0; e < elements_.size() && d == 2; ++e) sign_[e] = with[elements_[e].sense] >= 0 ? 1 : -1;
  }

  /// The sign of the straight-sided element's J against the normals.
  double mean_sign(std::size_t e) const {
    const Vectors x = positions(e), n = normals(e);
    const Eigen::Vector3d normal = n.rowwise().sum();
    if constexpr (d == 1)
      return normal.dot(x.col(1) - x.col(0)) < 0 ? -1 : 1;
    else
      return normal.dot((x.col(1) - x.col(0)).cross(x.col(2) - x.col(0))) < 0 ? -1 : 1;
  }

  Vectors positions(std::size_t e) const {
    Vectors x(3, static_cast<Eigen::Index>(local_[e].size()));
    for (std::size_t k = 0; k < local_[e].size(); ++k)
      x.col(static_cast<Eigen::Index>(k)) = nodes_[static_cast<std::size_t>(local_[e][k])].x;
    return x;
  }
  Vectors normals(std::size_t e) const {
    Vectors n(3, static_cast<Eigen::Index>(local_[e].size()));
    for (std::size_t k = 0; k < local_[e].size(); ++k)
      n.col(static_cast<Eigen::Index>(k)) = sign_[e] * normals_.col(local_[e][k]);
    return n;
  }

  typename EntityEnergy<d>::Value total(double delta) const {
    typename EntityEnergy<d>::Value sum{0, std::numeric_limits<double>::infinity()};
    for (std::size_t e = 0; e < elements_.size(); ++e) {
      const auto value = energy_.value(e, positions(e), normals(e), delta);
      sum.energy += value.energy;
      sum.least = std::min(sum.least, value.least);
    }
    return sum;
  }

  std::int64_t folded() const {
    std::int64_t count = 0;
    for (std::size_t e = 0; e < elements_.size(); ++e)
      count += energy_.value(e, positions(e), normals(e), 1).least <= 0 ? 1 : 0;
    return count;
  }

  /// One step. Returns the largest movement relative to the distance between nodes; not finite if nothing can be
  /// solved.
  double iterate(double delta) {
    std::vector<Eigen::Matrix<double, 3, d>> tangents(nodes_.size());
    for (std::size_t i = 0; i < nodes_.size(); ++i)
      if (first_[i] >= 0) {
        if constexpr (d == 1)
          tangents[i] = S_[i].col(0).normalized();
        else {
          const auto normal = normals_.col(static_cast<Eigen::Index>(i));
          tangents[i].col(0) = (S_[i].col(0) - normal * normal.dot(S_[i].col(0))).normalized();
          tangents[i].col(1) = normals_.col(static_cast<Eigen::Index>(i)).cross(tangents[i].col(0));
        }
      }
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
    std::vector<Eigen::Vector3d> wish(nodes_.size(), Eigen::Vector3d::Zero());
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      if (first_[i] < 0) continue;
      wish[i] = tangents[i] * step.segment<d>(first_[i]);
      const double most = 0.5 * spacing_[i];
      if (wish[i].norm() > most) wish[i] *= most / wish[i].norm();
    }
    return search(delta, wish);
  }

  void assemble(double delta, const std::vector<Eigen::Matrix<double, 3, d>>& tangents, Eigen::VectorXd& slope,
                std::vector<Eigen::Triplet<double>>& entries) const {
    Eigen::VectorXd gradient;
    Eigen::MatrixXd hessian;
    for (std::size_t e = 0; e < elements_.size(); ++e) {
      energy_.derivatives(e, positions(e), normals(e), delta, gradient, hessian);
      for (std::size_t a = 0; a < local_[e].size(); ++a) {
        const auto i = static_cast<std::size_t>(local_[e][a]);
        if (first_[i] < 0) continue;
        slope.segment<d>(first_[i]) += tangents[i].transpose() * gradient.segment<3>(static_cast<Eigen::Index>(3 * a));
        for (std::size_t b = 0; b < local_[e].size(); ++b) {
          const auto j = static_cast<std::size_t>(local_[e][b]);
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
    const std::vector<EntityNode> before = nodes_;
    const double energy = total(delta).energy;
    double length = 1;
    for (int half = 0; half < kMostHalvings; ++half, length /= 2) {
      double largest = 0;
      for (std::size_t i = 0; i < nodes_.size(); ++i) {
        if (first_[i] < 0) continue;
        nodes_[i] = moved(before[i], S_[i], length * wish[i]);
        largest = std::max(largest, (nodes_[i].x - before[i].x).norm() / spacing_[i]);
      }
      const auto value = total(delta);
      if (!(value.energy < energy) || !std::isfinite(largest)) continue;
      take_normals();
      least_ = total(delta == 0 ? 1 : delta).least;
      return largest;
    }
    nodes_ = before;
    return 0;
  }

  EntityNode moved(const EntityNode& node, const Eigen::Matrix<double, 3, Eigen::Dynamic>& S,
                   const Eigen::Vector3d& by) const {
    EntityNode result = node;
    std::array<double, 2> at = node.at;
    Eigen::Vector3d x = node.x;
    if (entity_.steps_in_parameters()) {
      const Eigen::Matrix<double, d, d> metric = S.transpose() * S;
      const Eigen::Matrix<double, d, 1> change = metric.inverse() * (S.transpose() * by);
      for (int k = 0; k < d; ++k) at[static_cast<std::size_t>(k)] += change[k];
      at = entity_.clamp(at);
      x = entity_.at(at).x;
    }
    // If the parameters are uneven, the tangent is no guide.
    if (!((x - node.x - by).norm() <= 0.3 * by.norm())) {
      at = entity_.closest(node.x + by, node.at);
      x = entity_.at(at).x;
    }
    if (!x.allFinite()) return node;
    result.at = at;
    result.x = x;
    return result;
  }

  Entity<d> entity_;
  const std::vector<EntityElement>& elements_;
  EntityEnergy<d> energy_;
  const StopToken* stop_;
  std::vector<EntityNode> nodes_;
  std::vector<std::vector<std::int32_t>> local_;  ///< By element: places of its nodes in nodes_.
  std::vector<double> spacing_, sign_;
  std::vector<bool> at_pole_;
  std::vector<Eigen::Matrix<double, 3, Eigen::Dynamic>> S_;
  Vectors normals_;
  std::vector<Eigen::Index> first_;  ///< By node: its first unknown; −1 if it is held.
  Eigen::Index unknowns_ = 0;
  double least_ = 0;  ///< Smallest J of all elements.
};

std::vector<std::int32_t> nodes_of(const std::vector<EntityElement>& elements) {
  std::vector<std::int32_t> nodes;
  for (const EntityElement& element : elements) nodes.insert(nodes.end(), element.nodes.begin(), element.nodes.end());
  std::ranges::sort(nodes);
  const auto repeated = std::ranges::unique(nodes);
  nodes.erase(repeated.begin(), repeated.end());
  return nodes;
}

Eigen::Vector3d position(const std::vector<double>& coordinates, std::int32_t node) {
  return Eigen::Map<const Eigen::Vector3d>(&coordinates[3 * static_cast<std::size_t>(node)]);
}

}  // namespace

std::vector<EntityNode> curve_nodes(int curve, const std::vector<EntityElement>& elements,
                                    const Association& association, const std::vector<double>& coordinates,
                                    const std::vector<bool>& fixed) {
  const geometry::CurveSearch search(*association.geometry.curves[static_cast<std::size_t>(curve)].shape);
  std::vector<EntityNode> nodes;
  for (const std::int32_t node : nodes_of(elements)) {
    const NodeEntity& entity = association.nodes[static_cast<std::size_t>(node)];
    const bool on = entity.dimension == 1 && entity.entity == curve;
    const Eigen::Vector3d x = position(coordinates, node);
    nodes.push_back({node, on && !fixed[static_cast<std::size_t>(node)],
                     on ? entity.at : std::array<double, 2>{search.closest(x).t, 0}, x});
  }
  return nodes;
}

std::vector<EntityNode> surface_nodes(int surface, const Association& association,
                                      const std::vector<double>& coordinates, const std::vector<bool>& fixed) {
  const SurfaceNodes& own = association.surfaces[static_cast<std::size_t>(surface)];
  std::vector<EntityNode> nodes;
  for (std::size_t i = 0; i < own.nodes.size(); ++i) {
    const std::int32_t node = own.nodes[i];
    const NodeEntity& entity = association.nodes[static_cast<std::size_t>(node)];
    const bool on = entity.dimension == 2 && entity.entity == surface;
    nodes.push_back(
        {node, on && !fixed[static_cast<std::size_t>(node)], own.parameters[i], position(coordinates, node)});
  }
  return nodes;
}

EntitySlide slide_on_curve(int curve, const std::vector<EntityElement>& elements, int order,
                           const Association& association, const std::vector<double>& at_start,
                           std::vector<EntityNode> nodes, int most_iterations, const StopToken* stop) {
  return EntityNewton<1>(Entity<1>(association, curve), elements, order, at_start, stop)
      .run(std::move(nodes), most_iterations);
}

EntitySlide slide_on_surface(int surface, const std::vector<EntityElement>& elements, int order,
                             const Association& association, const std::vector<double>& at_start,
                             std::vector<EntityNode> nodes, int most_iterations, const StopToken* stop) {
  return EntityNewton<2>(Entity<2>(association, surface), elements, order, at_start, stop)
      .run(std::move(nodes), most_iterations);
}

}  // namespace varimesh::detail
