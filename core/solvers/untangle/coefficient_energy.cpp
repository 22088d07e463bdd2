// The energy of untangling and its derivatives, one cell at a time.
#include "core/solvers/untangle/coefficient_energy.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "core/kernels/dense/dense_product.h"
#include "core/kernels/p_norm.h"

namespace varimesh {
namespace {

constexpr double kTheta = 0.5;
constexpr double kUnrepairableEpsilon = 1;
/// Entries of ∂B/∂x below this share of the largest one are rounding errors of 0.
constexpr double kNoSlope = 1e-12;

template <int d>
using Matrix = Eigen::Matrix<double, d, d>;
/// Numbers per node: nodes × d.
template <int d>
using PerNode = Eigen::Matrix<double, Eigen::Dynamic, d>;

/// Calls work(std::integral_constant<int, d>) with the dimension d. Known sizes make loops over points several times
/// faster than sizes that are known only at run time.
template <class Work>
auto with_dimension(int dimension, const Work& work) {
  return dimension == 2 ? work(std::integral_constant<int, 2>()) : work(std::integral_constant<int, 3>());
}

// ---------------------------------------------------------------------------------------------------------------------
// Functions of I = |F|² and J
// ---------------------------------------------------------------------------------------------------------------------

/// s = √(J² + ε²) and χ. For J < 0, where s + J cancels, χ is computed as ε²/(2 (s − J)).
struct Regularised {
  double s, chi;
  Regularised(double jacobian, double epsilon)
      : s(std::hypot(jacobian, epsilon)),
        chi(jacobian > 0 ? (s + jacobian) / 2 : epsilon * epsilon / (2 * (s - jacobian))) {}
};

/// f = I b/d with b = χ^−m, m = 2/d, and
///     f_I = b/d,  f_J = −m I b/(d s),  f_IJ = −m b/(d s),  f_JJ = I b/(d s²) max(m (m + J/s), 2 m²).
/// The second derivative without f_J d²J is 2 f_I |dF|² + 4 f_IJ (F:dF)(C:dF) + f_JJ (C:dF)². Since |dF|² ≥ (F:dF)²/I,
/// it is not negative if f_JJ is at least I b 2 m²/(d s²). The exact f_JJ has m (m + J/s) instead of 2 m², which is
/// less if J/s < m.
struct ShapeTerm {
  double f, I_slope, J_slope, IJ, JJ;
  ShapeTerm(double I, double jacobian, double epsilon, int d) {
    const Regularised r(jacobian, epsilon);
    const double m = 2.0 / d, b = std::pow(r.chi, -m);
    f = I * b / d;
    I_slope = b / d;
    J_slope = -m * I * b / (d * r.s);
    IJ = -m * b / (d * r.s);
    JJ = I * b / (d * r.s * r.s) * std::max(m * (m + jacobian / r.s), 2 * m * m);
  }
};

/// h = (B² + 1)/χ, h' = 2 B/χ − (B² + 1)/(χ s), h'' = 2/χ − 4 B/(χ s) + 2 (B² + 1)/s³, or 0 if that is negative.
struct Barrier {
  double h, slope, curvature;
  Barrier(double B, double epsilon) {
    const Regularised r(B, epsilon);
    h = (B * B + 1) / r.chi;
    slope = 2 * B / r.chi - h / r.s;
    curvature = std::max(0.0, 2 / r.chi - 4 * B / (r.chi * r.s) + 2 * (B * B + 1) / (r.s * r.s * r.s));
  }
};

// ---------------------------------------------------------------------------------------------------------------------
// The map at a quadrature point
// ---------------------------------------------------------------------------------------------------------------------

/// The target at quadrature point q: A⁻¹, and weight times |det A|.
template <int d>
struct Point {
  Matrix<d> inverse_target;
  double weight;
  Point(const CellSet& set, std::int32_t cell, int q) {
    const double *inverse = set.inverse_target_of(cell), *measure = set.measure_of(cell);
    const int stride = set.affine ? 1 : set.stride, at = set.affine ? 0 : q;
    for (int i = 0; i < d; ++i)
      for (int k = 0; k < d; ++k) inverse_target(i, k) = inverse[(i * d + k) * stride + at];
    weight = set.affine ? set.weights[static_cast<std::size_t>(q)] * measure[0] : measure[q];
  }
};

/// L of the cell.
template <int d>
Matrix<d> left_factor(const CellSet& set, std::int32_t cell) {
  const double* factor = set.left_factor_of(cell);
  if (factor == nullptr) return Matrix<d>::Identity();
  return Eigen::Map<const Eigen::Matrix<double, d, d, Eigen::RowMajor>>(factor);
}

/// cof F = ∂J/∂F.
Matrix<2> cofactor(const Matrix<2>& F) {
  Matrix<2> C;
  C << F(1, 1), -F(1, 0), -F(0, 1), F(0, 0);
  return C;
}

Matrix<3> cofactor(const Matrix<3>& F) {
  Matrix<3> C;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      C(i, j) = F((i + 1) % 3, (j + 1) % 3) * F((i + 2) % 3, (j + 2) % 3) -
                F((i + 1) % 3, (j + 2) % 3) * F((i + 2) % 3, (j + 1) % 3);
  return C;
}

}  // namespace

double regularised_jacobian(double jacobian, double epsilon) { return Regularised(jacobian, epsilon).chi; }

CoefficientEnergy::CoefficientEnergy(const CellSet& set)
    : set_(set),
      table_(coefficient_table(set.shape, set.order)),
      gradients_(set.nodes_per_cell, static_cast<Eigen::Index>(set.points) * set.dimension) {
  for (int q = 0; q < set.points; ++q)
    for (int k = 0; k < set.dimension; ++k)
      for (int n = 0; n < set.nodes_per_cell; ++n)
        gradients_(n, q * set.dimension + k) = set.derivatives_of(n)[k * set.stride + q];
}

double CoefficientEnergy::coefficient_scale(std::int32_t cell) const {
  double weights = 0;
  for (int q = 0; q < set_.points; ++q) weights += set_.weights[static_cast<std::size_t>(q)];
  const double scale = weights / cell_measure(set_, cell);
  const bool mirrored = with_dimension(set_.dimension, [&](auto dimension) {
    return Point<dimension()>(set_, cell, 0).inverse_target.determinant() < 0;
  });
  return mirrored ? -scale : scale;
}

Eigen::VectorXd CoefficientEnergy::coefficients(const Cell& cell) const {
  const auto derivatives = table_.derivatives(cell.positions);
  return coefficient_scale(cell.number) * table_.jacobian(derivatives, table_.cofactors(derivatives));
}

void CoefficientEnergy::find_movable(Cell& cell, const StopToken* stop) const {
  cell.movable.clear();
  if (cell.unrepairable) return;
  const Eigen::MatrixXd slope = table_.slope(table_.cofactors(table_.derivatives(cell.positions)), cell.free, stop);
  const double least = slope.size() > 0 ? kNoSlope * slope.cwiseAbs().maxCoeff() : 0;
  for (int k = 0; k < table_.size; ++k)
    if ((slope.row(k).array().abs() > least).any()) cell.movable.push_back(k);
}

double CoefficientEnergy::smallest_coefficient(const Cell& cell) const {
  if (cell.movable.empty()) return std::numeric_limits<double>::infinity();
  return coefficients(cell)(cell.movable).minCoeff();
}

double CoefficientEnergy::value(const Cell& cell, double epsilon) const {
  return shape_value(cell, epsilon) + barrier_value(cell, epsilon);
}

double CoefficientEnergy::shape_value(const Cell& cell, double epsilon) const {
  return with_dimension(set_.dimension, [&](auto dimension) { return shape_value_in<dimension()>(cell, epsilon); });
}

template <int d>
double CoefficientEnergy::shape_value_in(const Cell& cell, double epsilon) const {
  const Matrix<d> factor = left_factor<d>(set_, cell.number);
  const double measure = cell_measure(set_, cell.number), at = cell.unrepairable ? kUnrepairableEpsilon : epsilon;
  const Eigen::Map<const PerNode<d>> positions(cell.positions.data(), set_.nodes_per_cell, d);
  double sum = 0;
  for (int q = 0; q < set_.points; ++q) {
    const Point<d> point(set_, cell.number, q);
    const Matrix<d> F =
        factor * positions.transpose().lazyProduct(gradients_.middleCols<d>(q * d)) * point.inverse_target;
    sum += point.weight / measure * ShapeTerm(F.squaredNorm(), F.determinant(), at, d).f;
  }
  return sum;
}

double CoefficientEnergy::barrier_value(const Cell& cell, double epsilon) const {
  if (cell.movable.empty()) return 0;
  const Eigen::VectorXd B = coefficients(cell);
  double sum = 0;
  for (const int k : cell.movable) sum += Barrier(B[k], epsilon).h;
  return kTheta / 2 * sum / static_cast<double>(cell.movable.size());
}

CoefficientEnergy::Expansion CoefficientEnergy::expand(const Cell& cell, double epsilon, const StopToken* stop) const {
  const Eigen::Index unknowns = static_cast<Eigen::Index>(cell.free.size()) * set_.dimension;
  Expansion out{0, Eigen::VectorXd::Zero(unknowns), Eigen::MatrixXd::Zero(unknowns, unknowns)};
  if (unknowns == 0) return out;
  add_shape(cell, epsilon, stop, out);
  if (!cell.movable.empty()) add_barrier(cell, epsilon, stop, out);
  out.hessian.triangularView<Eigen::StrictlyUpper>() = out.hessian.transpose();
  return out;
}

/// With g_n = A⁻ᵀ ∇φ_n at a point, moving node n by a adds L a ⊗ g_n to F. So F:dF = a · y_n with y = L F g, C:dF = a ·
/// c_n with c = L C g, and |dF|² = Σ (L a_m · L a_n)(g_m · g_n).
void CoefficientEnergy::add_shape(const Cell& cell, double epsilon, const StopToken* stop, Expansion& out) const {
  with_dimension(set_.dimension, [&](auto dimension) { add_shape_in<dimension()>(cell, epsilon, stop, out); });
}

template <int d>
void CoefficientEnergy::add_shape_in(const Cell& cell, double epsilon, const StopToken* stop, Expansion& out) const {
  const int points = set_.points;
  const Eigen::Index nodes = static_cast<Eigen::Index>(cell.free.size());
  const Matrix<d> factor = left_factor<d>(set_, cell.number);
  const double measure = cell_measure(set_, cell.number), at = cell.unrepairable ? kUnrepairableEpsilon : epsilon;
  const Eigen::Map<const PerNode<d>> positions(cell.positions.data(), set_.nodes_per_cell, d);
  // The part with F:dF and C:dF is left rightᵀ, and the part with |dF|² is from weighted gradientsᵀ.
  Eigen::MatrixXd gradients(nodes, points * d), weighted(nodes, points * d);
  Eigen::MatrixXd left(nodes * d, 2 * points), right(nodes * d, 2 * points);
  for (int q = 0; q < points; ++q) {
    look(stop);
    const Point<d> point(set_, cell.number, q);
    const auto reference = gradients_.middleCols<d>(q * d);
    const Matrix<d> F = factor * positions.transpose().lazyProduct(reference) * point.inverse_target, C = cofactor(F);
    const Matrix<d> LF = factor * F, LC = factor * C;
    const ShapeTerm f(F.squaredNorm(), F.determinant(), at, d);
    const double w = point.weight / measure;
    Eigen::VectorXd y(nodes * d), c(nodes * d);
    for (Eigen::Index n = 0; n < nodes; ++n) {
      const Eigen::Matrix<double, 1, d> g =
          reference.row(cell.free[static_cast<std::size_t>(n)]) * point.inverse_target;
      gradients.template block<1, d>(n, q * d) = g;
      y.template segment<d>(n * d) = LF * g.transpose();
      c.template segment<d>(n * d) = LC * g.transpose();
    }
    weighted.template middleCols<d>(q * d) = 2 * w * f.I_slope * gradients.template middleCols<d>(q * d);
    left.col(2 * q) = c;
    right.col(2 * q) = 2 * w * f.IJ * y + w * f.JJ * c;
    left.col(2 * q + 1) = y;
    right.col(2 * q + 1) = 2 * w * f.IJ * c;
    out.value += w * f.f;
    out.gradient.noalias() += w * (2 * f.I_slope * y + f.J_slope * c);
  }
  detail::add_product(left, right, out.hessian.data(), nodes * d, detail::Entries::Lower, stop);
  Eigen::MatrixXd plain = Eigen::MatrixXd::Zero(nodes, nodes);
  detail::add_product(weighted, gradients, plain.data(), nodes, detail::Entries::Lower, stop);
  const Matrix<d> square = factor * factor;
  for (Eigen::Index n = 0; n < nodes; ++n)
    for (Eigen::Index m = n; m < nodes; ++m) out.hessian.template block<d, d>(m * d, n * d) += plain(m, n) * square;
}

void CoefficientEnergy::add_barrier(const Cell& cell, double epsilon, const StopToken* stop, Expansion& out) const {
  const auto derivatives = table_.derivatives(cell.positions);
  const auto cofactors = table_.cofactors(derivatives);
  const double scale = coefficient_scale(cell.number);
  const double share = kTheta / 2 / static_cast<double>(cell.movable.size());
  const Eigen::VectorXd B = scale * table_.jacobian(derivatives, cofactors);
  const Eigen::MatrixXd slope = scale * table_.slope(cofactors, cell.free, stop);
  Eigen::VectorXd first = Eigen::VectorXd::Zero(table_.size), second = first;
  for (const int k : cell.movable) {
    const Barrier at(B[k], epsilon);
    out.value += share * at.h;
    first[k] = share * at.slope;
    second[k] = std::sqrt(share * at.curvature);
  }
  out.gradient.noalias() += slope.transpose() * first;
  const Eigen::MatrixXd root = (second.asDiagonal() * slope).transpose();
  detail::add_product(root, root, out.hessian.data(), root.rows(), detail::Entries::Lower, stop);
}

}  // namespace varimesh
