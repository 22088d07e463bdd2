#include "core/slide/entity_form.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/geometry/closest_point.h"

namespace varimesh::detail {
namespace {

// ===== The two kinds of entity =====

template <int d>
struct Tangents {
  Eigen::Matrix<double, 3, d> S;  ///< First derivatives.
  Eigen::Vector3d x, normal;      ///< Point; unit normal, for a curve the unit tangent.
};

template <int d>
class Entity;

template <>
class Entity<1> {
 public:
  Entity(const Association& association, int curve)
      : shape_(*association.geometry.curves[static_cast<std::size_t>(curve)].shape) {}
  Tangents<1> at(const std::array<double, 2>& at) const {
    const geometry::CurvePoint p = shape_.at(at[0]);
    return {p.dt, p.x, p.dt.normalized()};
  }
  bool steps_in_parameters() const { return true; }
  std::array<double, 2> clamp(const std::array<double, 2>& at) const { return {shape_.range().clamp(at[0]), 0}; }
  std::array<double, 2> closest(const Eigen::Vector3d& x, const std::array<double, 2>& guess) const {
    return {geometry::closest_from(shape_, x, guess[0]).t, 0};
  }
  /// Second derivatives along a vector, by the parameter.
  Eigen::Matrix<double, 1, 1> second(const std::array<double, 2>& at, const Eigen::Vector3d& along) const {
    return Eigen::Matrix<double, 1, 1>(along.dot(shape_.at(at[0]).dtt));
  }

 private:
  const geometry::CurveShape& shape_;
};

template <>
class Entity<2> {
 public:
  Entity(const Association& association, int surface)
      : shape_(*association.geometry.surfaces[static_cast<std::size_t>(surface)].shape) {}
  Tangents<2> at(const std::array<double, 2>& at) const {
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
  Eigen::Matrix2d second(const std::array<double, 2>& at, const Eigen::Vector3d& along) const {
    const geometry::SurfacePoint p = shape_.at(at[0], at[1]);
    Eigen::Matrix2d L;
    L << along.dot(p.duu), along.dot(p.duv), along.dot(p.duv), along.dot(p.dvv);
    return L;
  }

 private:
  const geometry::SurfaceShape& shape_;
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

// ===== The form =====

template <int d>
EntityForm<d>::EntityForm(const Association& association, int entity, const std::vector<EntityElement>& elements,
                          int order, const std::vector<double>& at_start)
    : association_(association), entity_(entity), elements_(elements), energy_(elements, order, at_start) {}

template <int d>
void EntityForm<d>::set_nodes(std::vector<EntityNode> nodes) {
  nodes_ = std::move(nodes);
  local_.assign(elements_.size(), {});
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
}

template <int d>
void EntityForm<d>::leave_out_constant_points() {
  for (std::size_t e = 0; e < local_.size(); ++e) {
    std::vector<bool> free;
    for (const std::int32_t place : local_[e]) free.push_back(nodes_[static_cast<std::size_t>(place)].free);
    energy_.leave_out_constant_points(e, free);
  }
}

template <int d>
void EntityForm<d>::take_normals() {
  const Entity<d> entity(association_, entity_);
  normals_.setZero(3, static_cast<Eigen::Index>(nodes_.size()));
  at_pole_.assign(nodes_.size(), false);
  S_.resize(nodes_.size());
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const Tangents<d> here = entity.at(nodes_[i].at);
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

template <int d>
Eigen::Matrix<double, 3, d> EntityForm<d>::tangents(std::size_t node) const {
  Eigen::Matrix<double, 3, d> T;
  if constexpr (d == 1) {
    T.col(0) = S_[node].col(0).normalized();
  } else {
    const auto normal = normals_.col(static_cast<Eigen::Index>(node));
    T.col(0) = (S_[node].col(0) - normal * normal.dot(S_[node].col(0))).normalized();
    T.col(1) = normal.cross(T.col(0));
  }
  return T;
}

// With x(q) = x + S du + ½ L(du, du) and du = M q, M = (TᵀS)⁻¹, the part of L along the tangents is a change of
// parameters and has no meaning. What remains is L across them.
template <int d>
Eigen::Matrix<double, d, d> EntityForm<d>::curvature(std::size_t node, const Eigen::Vector3d& gradient) const {
  const Eigen::Matrix<double, 3, d> T = tangents(node);
  const Eigen::Vector3d across = gradient - T * (T.transpose() * gradient);
  const Eigen::Matrix<double, d, d> M = (T.transpose() * S_[node]).inverse();
  return M.transpose() * Entity<d>(association_, entity_).second(nodes_[node].at, across) * M;
}

template <int d>
EntityNode EntityForm<d>::moved(const EntityNode& node, std::size_t place, const Eigen::Vector3d& by) const {
  const Entity<d> entity(association_, entity_);
  EntityNode result = node;
  std::array<double, 2> at = node.at;
  Eigen::Vector3d x = node.x;
  if (entity.steps_in_parameters()) {
    const Eigen::Matrix<double, 3, d>& S = S_[place];
    const Eigen::Matrix<double, d, d> metric = S.transpose() * S;
    const Eigen::Matrix<double, d, 1> change = metric.inverse() * (S.transpose() * by);
    for (int k = 0; k < d; ++k) at[static_cast<std::size_t>(k)] += change[k];
    at = entity.clamp(at);
    x = entity.at(at).x;
  }
  // If the parameters are uneven, the tangent is no guide.
  if (!((x - node.x - by).norm() <= 0.3 * by.norm())) {
    at = entity.closest(node.x + by, node.at);
    x = entity.at(at).x;
  }
  if (!x.allFinite()) return node;
  result.at = at;
  result.x = x;
  return result;
}

template <int d>
std::array<double, 2> EntityForm<d>::closest(const Eigen::Vector3d& x, const std::array<double, 2>& guess) const {
  return Entity<d>(association_, entity_).closest(x, guess);
}

template <int d>
EntityNode EntityForm<d>::put(const EntityNode& node, const Eigen::Vector3d& x) const {
  EntityNode result = node;
  result.at = closest(x, node.at);
  result.x = Entity<d>(association_, entity_).at(result.at).x;
  return result.x.allFinite() ? result : node;
}

template <int d>
typename EntityForm<d>::Value EntityForm<d>::value(std::size_t element, double delta) const {
  return energy_.value(element, positions(element), normals(element), delta);
}

template <int d>
void EntityForm<d>::derivatives(std::size_t element, double delta, Eigen::VectorXd& gradient,
                                Eigen::MatrixXd& hessian) const {
  energy_.derivatives(element, positions(element), normals(element), delta, gradient, hessian);
}

template <int d>
std::vector<typename EntityForm<d>::Value> EntityForm<d>::values(double delta, const Team& team) const {
  std::vector<Value> values(elements_.size());
  team.for_each(static_cast<std::int32_t>(values.size()), kGrain, [&](std::int32_t e) {
    values[static_cast<std::size_t>(e)] = value(static_cast<std::size_t>(e), delta);
  });
  return values;
}

template <int d>
typename EntityForm<d>::Value EntityForm<d>::total(double delta, const Team& team) const {
  Value sum{0, std::numeric_limits<double>::infinity()};
  for (const Value& one : values(delta, team)) {
    sum.energy += one.energy;
    sum.least = std::min(sum.least, one.least);
    sum.least_movable = std::min(sum.least_movable, one.least_movable);
  }
  return sum;
}

template <int d>
std::int64_t EntityForm<d>::folded(const Team& team) const {
  return std::ranges::count_if(values(1, team), [](const Value& value) { return value.least <= 0; });
}

template <int d>
void EntityForm<d>::orient() {
  std::map<int, std::int64_t> with;
  for (std::size_t e = 0; e < elements_.size(); ++e) {
    sign_[e] = mean_sign(e);
    with[elements_[e].sense] += sign_[e] > 0 ? 1 : -1;
  }
  for (std::size_t e = 0; e < elements_.size() && d == 2; ++e) sign_[e] = with[elements_[e].sense] >= 0 ? 1 : -1;
}

/// The sign of the straight-sided element's J against the normals.
template <int d>
double EntityForm<d>::mean_sign(std::size_t e) const {
  const Vectors x = positions(e), n = normals(e);
  const Eigen::Vector3d normal = n.rowwise().sum();
  if constexpr (d == 1)
    return normal.dot(x.col(1) - x.col(0)) < 0 ? -1 : 1;
  else
    return normal.dot((x.col(1) - x.col(0)).cross(x.col(2) - x.col(0))) < 0 ? -1 : 1;
}

template <int d>
typename EntityForm<d>::Vectors EntityForm<d>::positions(std::size_t e) const {
  Vectors x(3, static_cast<Eigen::Index>(local_[e].size()));
  for (std::size_t k = 0; k < local_[e].size(); ++k)
    x.col(static_cast<Eigen::Index>(k)) = nodes_[static_cast<std::size_t>(local_[e][k])].x;
  return x;
}

template <int d>
typename EntityForm<d>::Vectors EntityForm<d>::normals(std::size_t e) const {
  Vectors n(3, static_cast<Eigen::Index>(local_[e].size()));
  for (std::size_t k = 0; k < local_[e].size(); ++k)
    n.col(static_cast<Eigen::Index>(k)) = sign_[e] * normals_.col(local_[e][k]);
  return n;
}

template class EntityForm<1>;
template class EntityForm<2>;

// ===== Nodes =====

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

}  // namespace varimesh::detail
