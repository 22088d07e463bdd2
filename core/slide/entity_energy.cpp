#include "core/slide/entity_energy.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/energy/hyperelastic-inl.h"
#include "core/kernels/dense/dense_product.h"
#include "core/problem/regular_shape.h"

namespace varimesh::detail {
namespace {

using Energy1 = HWY_NAMESPACE::HyperelasticEnergy<1>;
using Energy2 = HWY_NAMESPACE::HyperelasticEnergy<2>;

template <int d>
using Energy = std::conditional_t<d == 1, Energy1, Energy2>;

template <int d>
HWY_NAMESPACE::Regularised<double> regularised(double J, double delta) {
  return HWY_NAMESPACE::regularised<Energy<d>::kFunction>(J, delta * delta);
}

/// Whether the straight-sided element with these vertices looks the other way at a point than on average. A triangle
/// never does.
bool is_tangled(const EntityTable& table, const Eigen::Matrix3Xd& x) {
  if (x.cols() != 4) return false;
  Eigen::Matrix3Xd normals(3, table.weights.size());
  for (Eigen::Index p = 0; p < normals.cols(); ++p) {
    const Eigen::Vector3d along = x * table.straight[0].row(p).transpose();
    const Eigen::Vector3d across = x * table.straight[1].row(p).transpose();
    normals.col(p) = along.cross(across);
  }
  const Eigen::Vector3d mean = normals * table.weights;
  const Eigen::VectorXd along_mean = normals.transpose() * mean;
  return along_mean.minCoeff() <= 0;
}

/// The derivative of the square on the mean of the edges of a quadrilateral.
Eigen::Matrix2d square_for(const Eigen::Matrix3Xd& x) {
  double edges = 0;
  for (Eigen::Index k = 0; k < 4; ++k) edges += (x.col(k) - x.col((k + 1) % 4)).norm();
  return edges / 4 * regular_shape(Shape::Quadrilateral).topLeftCorner<2, 2>();
}

/// A straight-sided element that is flatter than this at a point has no target there.
constexpr double kFlat = 1e-6;
/// Derivatives of a basis function that are smaller than this are zero up to rounding.
constexpr double kZeroDerivative = 1e-10;

}  // namespace

/// All points of one element. Products of whole matrices are several times as fast as those point by point.
template <int d>
struct EntityEnergy<d>::Points {
  Vectors F[d];          ///< By column of F: 3 × points.
  Vectors normal;        ///< 3 × points.
  Eigen::VectorXd Q, J;  ///< By point: |F|², J.
};

/// What the derivatives are made of, by direction k of the reference element and by point: factors of ∂φ/∂ξ_k and, in
/// the stiffness, of ∂φ/∂ξ_k ∂φ/∂ξ_l.
template <int d>
struct EntityEnergy<d>::Terms {
  Vectors slope[d];                 ///< Of the gradient: 3 × points.
  Vectors volume[d];                ///< Of the changes of J, with the root of their factor in the Hessian: 3 × points.
  Eigen::VectorXd stiffness[d][d];  ///< Of the Hessian's multiples of I: by point.
};

template <int d>
EntityEnergy<d>::EntityEnergy(const std::vector<EntityElement>& elements, int order,
                              const std::vector<double>& coordinates)
    : material_(material(Options{})) {
  for (const EntityElement& element : elements) {
    const EntityTable& table = entity_table(element.shape, order);
    tables_.push_back(&table);
    const int vertices = reference::info(element.shape).vertices;
    Vectors x(3, vertices);
    for (int k = 0; k < vertices; ++k)
      x.col(k) = Eigen::Map<const Eigen::Vector3d>(
          &coordinates[3 * static_cast<std::size_t>(element.nodes[static_cast<std::size_t>(k)])]);
    double shortest = std::numeric_limits<double>::infinity();
    for (int k = 0; k < (vertices == 2 ? 1 : vertices); ++k)
      shortest = std::min(shortest, (x.col(k) - x.col((k + 1) % vertices)).norm());
    spacing_.push_back(shortest / order);
    double measure = 0;
    auto& inverse = inverse_.emplace_back();
    const bool tangled = is_tangled(table, x);
    for (Eigen::Index p = 0; p < table.weights.size(); ++p) {
      Eigen::Matrix<double, 3, d> G;
      for (int k = 0; k < d; ++k) G.col(k) = x * table.straight[static_cast<std::size_t>(k)].row(p).transpose();
      const Eigen::HouseholderQR<Eigen::Matrix<double, 3, d>> factors(G);
      Eigen::Matrix<double, d, d> R = factors.matrixQR().template topRows<d>().template triangularView<Eigen::Upper>();
      if constexpr (d == 2)
        if (tangled) R = square_for(x);
      const double area = std::abs(R.determinant());
      measure += table.weights[p] * area;
      const bool flat = !(area > kFlat * std::pow(R.norm(), d));
      inverse.push_back(flat ? Eigen::Matrix<double, d, d>::Zero() : Eigen::Matrix<double, d, d>(R.inverse()));
      // R is unique up to signs of its rows; its determinant must be positive for J to have the sign of N.
      if (R.determinant() < 0) inverse.back().col(d - 1) *= -1;
    }
    measure_.push_back(measure);
  }
  constant_.resize(elements.size());
}

template <int d>
void EntityEnergy<d>::leave_out_constant_points(std::size_t element, const std::vector<bool>& free) {
  const EntityTable& table = *tables_[element];
  std::vector<bool>& constant = constant_[element];
  constant.assign(static_cast<std::size_t>(table.weights.size()), true);
  for (std::size_t p = 0; p < constant.size(); ++p)
    for (std::size_t node = 0; node < free.size(); ++node)
      for (int k = 0; k < d; ++k)
        if (free[node] && std::abs(table.derivatives[static_cast<std::size_t>(k)](
                              static_cast<Eigen::Index>(node), static_cast<Eigen::Index>(p))) > kZeroDerivative)
          constant[p] = false;
}

template <int d>
typename EntityEnergy<d>::Points EntityEnergy<d>::points(std::size_t element, const Vectors& x,
                                                         const Vectors& normal) const {
  const EntityTable& table = *tables_[element];
  const std::vector<Eigen::Matrix<double, d, d>>& inverse = inverse_[element];
  Points all;
  for (int k = 0; k < d; ++k) all.F[k].noalias() = x * table.derivatives[static_cast<std::size_t>(k)];
  all.normal.noalias() = normal * table.values.transpose();
  const Eigen::Index count = table.weights.size();
  all.Q.resize(count);
  all.J.resize(count);
  for (Eigen::Index p = 0; p < count; ++p) {
    Eigen::Matrix<double, 3, d> F;
    for (int k = 0; k < d; ++k) F.col(k) = all.F[k].col(p);
    F *= inverse[static_cast<std::size_t>(p)];
    for (int k = 0; k < d; ++k) all.F[k].col(p) = F.col(k);
    all.normal.col(p).normalize();
    all.Q[p] = F.squaredNorm();
    if constexpr (d == 1)
      all.J[p] = all.normal.col(p).dot(F.col(0));
    else
      all.J[p] = all.normal.col(p).dot(F.col(0).cross(F.col(1)));
  }
  return all;
}

template <int d>
typename EntityEnergy<d>::Value EntityEnergy<d>::value(std::size_t element, const Vectors& x, const Vectors& normal,
                                                       double delta) const {
  const Energy<d> energy(material_);
  const Points all = points(element, x, normal);
  Value value{0, std::numeric_limits<double>::infinity()};
  for (Eigen::Index p = 0; p < all.J.size(); ++p) {
    if (has_no_target(element, p)) continue;
    const double J = all.J[p];
    value.least = std::min(value.least, J);
    if (is_constant(element, p)) continue;
    value.least_movable = std::min(value.least_movable, J);
    if (J <= 0 && delta == 0)
      value.energy = std::numeric_limits<double>::infinity();
    else
      value.energy += weight(element, p) * energy.value(all.Q[p], regularised<d>(J, delta));
  }
  return value;
}

// Node a moves by the vector a: F changes by a ⊗ g with g = R⁻ᵀ ∇φ, and J by a · c with c = C g, where C = N on a curve
// and C = (f₂ × N, N × f₁) on a surface. Per point, with the weight w,
//
//     gradient:  w (2 f_Q F + f_J C) g,      Hessian:  2 w f_Q (g_a · g_b) I + w f_JJ c_a ⊗ c_b.
template <int d>
typename EntityEnergy<d>::Terms EntityEnergy<d>::terms(std::size_t element, const Points& all, double delta) const {
  const Energy<d> energy(material_);
  const Eigen::Index count = all.J.size();
  Terms terms;
  for (int k = 0; k < d; ++k) {
    terms.slope[k].setZero(3, count);
    terms.volume[k].setZero(3, count);
    for (int l = 0; l < d; ++l) terms.stiffness[k][l].setZero(count);
  }
  for (Eigen::Index p = 0; p < count; ++p) {
    if (has_no_target(element, p) || is_constant(element, p)) continue;
    Eigen::Matrix<double, 3, d> F, C;
    for (int k = 0; k < d; ++k) F.col(k) = all.F[k].col(p);
    const Eigen::Vector3d N = all.normal.col(p);
    if constexpr (d == 1)
      C = N;
    else
      C << F.col(1).cross(N), N.cross(F.col(0));
    const auto partials = energy.partials(all.Q[p], regularised<d>(all.J[p], delta));
    const double w = weight(element, p);
    const Eigen::Matrix<double, d, d>& inverse = inverse_[element][static_cast<std::size_t>(p)];
    const Eigen::Matrix<double, 3, d> slope = w * (2 * partials.f_Q * F + partials.f_J * C) * inverse.transpose();
    const Eigen::Matrix<double, 3, d> volume = std::sqrt(w * std::max(partials.f_JJ, 0.0)) * C * inverse.transpose();
    const Eigen::Matrix<double, d, d> stiffness = 2 * w * partials.f_Q * inverse * inverse.transpose();
    for (int k = 0; k < d; ++k) {
      terms.slope[k].col(p) = slope.col(k);
      terms.volume[k].col(p) = volume.col(k);
      for (int l = 0; l < d; ++l) terms.stiffness[k][l][p] = stiffness(k, l);
    }
  }
  return terms;
}

template <int d>
void EntityEnergy<d>::derivatives(std::size_t element, const Vectors& x, const Vectors& normal, double delta,
                                  Eigen::VectorXd& gradient, Eigen::MatrixXd& hessian) const {
  const std::vector<Eigen::MatrixXd>& basis = tables_[element]->derivatives;
  const Terms of = terms(element, points(element, x, normal), delta);
  const Eigen::Index nodes = x.cols(), count = of.slope[0].cols();
  gradient.setZero(3 * nodes);
  hessian.setZero(3 * nodes, 3 * nodes);
  Eigen::Map<Vectors> slopes(gradient.data(), 3, nodes);
  Eigen::MatrixXd stiff = Eigen::MatrixXd::Zero(nodes, nodes), changes = Eigen::MatrixXd::Zero(3 * nodes, count);
  for (int k = 0; k < d; ++k) {
    const Eigen::MatrixXd& along = basis[static_cast<std::size_t>(k)];
    slopes.noalias() += of.slope[k] * along.transpose();
    Eigen::MatrixXd scaled = along * of.stiffness[k][k].asDiagonal();
    // The terms of (k, l) and (l, k) are transposes of each other. So the first counts twice here, and the mean of
    // `stiff` and its transpose is taken below.
    for (int l = k + 1; l < d; ++l)
      scaled += 2 * (basis[static_cast<std::size_t>(l)] * of.stiffness[k][l].asDiagonal());
    add_product(along, scaled, stiff.data(), nodes, Entries::All);
    for (Eigen::Index p = 0; p < count; ++p)
      Eigen::Map<Vectors>(changes.col(p).data(), 3, nodes).noalias() += of.volume[k].col(p) * along.col(p).transpose();
  }
  add_product(changes, changes, hessian.data(), 3 * nodes, Entries::Lower);
  for (Eigen::Index a = 0; a < nodes; ++a)
    for (Eigen::Index b = 0; b <= a; ++b)
      hessian.block<3, 3>(3 * a, 3 * b).diagonal().array() += (stiff(a, b) + stiff(b, a)) / 2;
  hessian.triangularView<Eigen::StrictlyUpper>() = hessian.transpose();
}

template class EntityEnergy<1>;
template class EntityEnergy<2>;

}  // namespace varimesh::detail
