#include "core/slide/entity_energy.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <limits>

#include "core/energy/hyperelastic-inl.h"

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

/// A straight-sided element that is flatter than this at a point has no target there.
constexpr double kFlat = 1e-6;

}  // namespace

/// One point of an element.
template <int d>
struct EntityEnergy<d>::Point {
  double weight, J;
  Eigen::Matrix<double, 3, d> F;
  Eigen::Vector3d normal;
  Eigen::Matrix<double, d, Eigen::Dynamic> slopes;  ///< By node: R⁻ᵀ ∇φ.
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
    for (Eigen::Index p = 0; p < table.weights.size(); ++p) {
      Eigen::Matrix<double, 3, d> G;
      for (int k = 0; k < d; ++k) G.col(k) = x * table.straight[static_cast<std::size_t>(k)].row(p).transpose();
      const Eigen::HouseholderQR<Eigen::Matrix<double, 3, d>> factors(G);
      Eigen::Matrix<double, d, d> R = factors.matrixQR().template topRows<d>().template triangularView<Eigen::Upper>();
      const double area = std::abs(R.determinant());
      measure += table.weights[p] * area;
      const bool flat = !(area > kFlat * std::pow(R.norm(), d));
      inverse.push_back(flat ? Eigen::Matrix<double, d, d>::Zero() : Eigen::Matrix<double, d, d>(R.inverse()));
      // R is unique up to signs of its rows; its determinant must be positive for J to have the sign of N.
      if (R.determinant() < 0) inverse.back().col(d - 1) *= -1;
    }
    measure_.push_back(measure);
  }
}

template <int d>
template <class Visit>
void EntityEnergy<d>::visit(std::size_t element, const Vectors& x, const Vectors& normal, const Visit& visit) const {
  const EntityTable& table = *tables_[element];
  Point point;
  for (Eigen::Index p = 0; p < table.weights.size(); ++p) {
    const Eigen::Matrix<double, d, d>& inverse = inverse_[element][static_cast<std::size_t>(p)];
    if (inverse.isZero(0)) continue;
    Eigen::Matrix<double, d, Eigen::Dynamic> basis(d, x.cols());
    for (int k = 0; k < d; ++k) basis.row(k) = table.derivatives[static_cast<std::size_t>(k)].row(p);
    point.weight = measure_[element] * table.weights[p];
    point.slopes = inverse.transpose() * basis;
    point.F = x * point.slopes.transpose();
    point.normal = (normal * table.values.row(p).transpose()).normalized();
    if constexpr (d == 1)
      point.J = point.normal.dot(point.F.col(0));
    else
      point.J = point.normal.dot(point.F.col(0).cross(point.F.col(1)));
    if (!visit(point)) return;
  }
}

template <int d>
typename EntityEnergy<d>::Value EntityEnergy<d>::value(std::size_t element, const Vectors& x, const Vectors& normal,
                                                       double delta) const {
  const Energy<d> energy(material_);
  Value value{0, std::numeric_limits<double>::infinity()};
  visit(element, x, normal, [&](const Point& point) {
    value.least = std::min(value.least, point.J);
    if (point.J <= 0 && delta == 0)
      value.energy = std::numeric_limits<double>::infinity();
    else
      value.energy += point.weight * energy.value(point.F.squaredNorm(), regularised<d>(point.J, delta));
    return true;
  });
  return value;
}

// Node a moves by the vector a: F changes by a ⊗ g, and J by a · c with c = g N on a curve and
// c = g₁ (f₂ × N) + g₂ (N × f₁) on a surface.
template <int d>
void EntityEnergy<d>::derivatives(std::size_t element, const Vectors& x, const Vectors& normal, double delta,
                                  Eigen::VectorXd& gradient, Eigen::MatrixXd& hessian) const {
  const Energy<d> energy(material_);
  const Eigen::Index nodes = x.cols();
  gradient.setZero(3 * nodes);
  hessian.setZero(3 * nodes, 3 * nodes);
  Vectors c(3, nodes);
  visit(element, x, normal, [&](const Point& point) {
    const auto partials = energy.partials(point.F.squaredNorm(), regularised<d>(point.J, delta));
    if constexpr (d == 1)
      c = point.normal * point.slopes;
    else
      c = point.F.col(1).cross(point.normal) * point.slopes.row(0) +
          point.normal.cross(point.F.col(0)) * point.slopes.row(1);
    const Vectors y = point.F * point.slopes;
    gradient += point.weight *
                Eigen::Map<const Eigen::VectorXd>(Vectors(2 * partials.f_Q * y + partials.f_J * c).data(), 3 * nodes);
    const Eigen::MatrixXd stiff = (2 * point.weight * partials.f_Q) * point.slopes.transpose() * point.slopes;
    for (Eigen::Index i = 0; i < nodes; ++i)
      for (Eigen::Index j = 0; j < nodes; ++j) hessian.block<3, 3>(3 * i, 3 * j).diagonal().array() += stiff(i, j);
    const Eigen::Map<const Eigen::VectorXd> all(c.data(), 3 * nodes);
    hessian.noalias() += (point.weight * std::max(partials.f_JJ, 0.0)) * all * all.transpose();
    return true;
  });
}

template class EntityEnergy<1>;
template class EntityEnergy<2>;

}  // namespace varimesh::detail
