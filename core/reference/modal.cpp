// The modes are products of Jacobi polynomials in collapsed coordinates (M. Dubiner, J. Sci. Comput. 6, 1991). On
// pyramids they are those of M. Bergot, G. Cohen, M. Duruflé, J. Sci. Comput. 42, 2010, which span the space of
// A. Johnen, C. Geuzaine, J. Comp. Phys. 299, 2015. On simplices they are evaluated by homogeneous recurrences,
// t^n P_n(x / t), which never divide. The same recurrences on dual numbers give exact derivatives without a singular
// vertex.
#include "core/reference/modal.h"

#include <cassert>
#include <cmath>
#include <numeric>

namespace varimesh::reference {
namespace {

/// A value and its gradient with respect to the reference coordinates.
struct Dual {
  double value = 0;
  std::array<double, 3> gradient{};

  Dual(double v = 0) : value(v) {}  // NOLINT(google-explicit-constructor): formulas contain constants

  static Dual coordinate(double v, int direction) {
    Dual d(v);
    d.gradient[direction] = 1;
    return d;
  }
};

Dual operator+(Dual a, const Dual& b) {
  a.value += b.value;
  for (int c = 0; c < 3; ++c) a.gradient[c] += b.gradient[c];
  return a;
}

Dual operator-(Dual a, const Dual& b) {
  a.value -= b.value;
  for (int c = 0; c < 3; ++c) a.gradient[c] -= b.gradient[c];
  return a;
}

Dual operator*(const Dual& a, const Dual& b) {
  Dual product(a.value * b.value);
  for (int c = 0; c < 3; ++c) product.gradient[c] = a.gradient[c] * b.value + a.value * b.gradient[c];
  return product;
}

Dual operator/(const Dual& a, const Dual& b) {
  Dual quotient(a.value / b.value);
  for (int c = 0; c < 3; ++c) quotient.gradient[c] = (a.gradient[c] - quotient.value * b.gradient[c]) / b.value;
  return quotient;
}

double value_of(double x) { return x; }
double value_of(const Dual& x) { return x.value; }

/// t^n P_n^{(a,0)}(x / t) for n = 0 … order, by the homogeneous form of the three-term recurrence (NIST Digital Library
/// of Mathematical Functions, 18.9.2).
template <class Number>
std::vector<Number> scaled_jacobi(int order, double a, const Number& x, const Number& t) {
  std::vector<Number> p(order + 1, Number(1));
  if (order >= 1) p[1] = Number((a + 2) / 2) * x + Number(a / 2) * t;
  for (int n = 1; n < order; ++n) {
    const double s = 2 * n + a, d = 2.0 * (n + 1) * (n + a + 1);
    const double linear = (s + 1) * (s + 2) / d;
    const double constant = a * a * (s + 1) / (d * s);
    const double previous = 2 * (n + a) * n * (s + 2) / (d * s);
    p[n + 1] = (Number(linear) * x + Number(constant) * t) * p[n] - Number(previous) * t * t * p[n - 1];
  }
  return p;
}

template <class Number>
using Coordinates = std::array<Number, 3>;

template <class Number>
std::vector<Number> line_modes(int order, const Coordinates<Number>& at) {
  std::vector<Number> modes = scaled_jacobi(order, 0, at[0], Number(1));
  for (int n = 0; n <= order; ++n) modes[n] = modes[n] * Number(std::sqrt((2 * n + 1) / 2.0));
  return modes;
}

template <class Number>
std::vector<Number> triangle_modes(int order, const Coordinates<Number>& at) {
  const Number one(1), half(0.5);
  const Number t = half * (one - at[1]);
  const std::vector<Number> first = scaled_jacobi(order, 0, at[0] + one - t, t);
  std::vector<Number> modes;
  for (int i = 0; i <= order; ++i) {
    const std::vector<Number> second = scaled_jacobi(order - i, 2 * i + 1, at[1], one);
    for (int j = 0; i + j <= order; ++j)
      modes.push_back(Number(std::sqrt((2 * i + 1) * (i + j + 1) / 2.0)) * first[i] * second[j]);
  }
  return modes;
}

template <class Number>
std::vector<Number> tetrahedron_modes(int order, const Coordinates<Number>& at) {
  const Number one(1), half(0.5);
  const Number t2 = half * (one - at[2]), t1 = half * (Number(0) - at[1] - at[2]);
  const std::vector<Number> first = scaled_jacobi(order, 0, at[0] + one - t1, t1);
  std::vector<Number> modes;
  for (int i = 0; i <= order; ++i) {
    const std::vector<Number> second = scaled_jacobi(order - i, 2 * i + 1, at[1] + one - t2, t2);
    for (int j = 0; i + j <= order; ++j) {
      const std::vector<Number> third = scaled_jacobi(order - i - j, 2 * i + 2 * j + 2, at[2], one);
      for (int k = 0; i + j + k <= order; ++k)
        modes.push_back(Number(std::sqrt((2 * i + 1) * (i + j + 1) * (2 * i + 2 * j + 2 * k + 3) / 4.0)) * first[i] *
                        second[j] * third[k]);
    }
  }
  return modes;
}

/// P_i(x/t) P_j(y/t) t^m P_k^{(2m+2,0)}(z), t = (1 − z)/2, m = max(i, j), k ≤ order − m. At the apex x/t may be any
/// number in [−1, 1]. Only the modes with m = 0 differ from zero there, so values exist but gradients do not.
template <class Number>
std::vector<Number> pyramid_modes(int order, const Coordinates<Number>& at) {
  const Number one(1), t = Number(0.5) * (one - at[2]);
  const bool apex = value_of(t) == 0;
  const std::vector<Number> first = scaled_jacobi(order, 0, apex ? Number(0) : at[0] / t, one);
  const std::vector<Number> second = scaled_jacobi(order, 0, apex ? Number(0) : at[1] / t, one);
  std::vector<Number> modes;
  Number power(1);
  for (int m = 0; m <= order; ++m, power = power * t) {
    const std::vector<Number> third = scaled_jacobi(order - m, 2 * m + 2, at[2], one);
    for (int i = 0; i <= m; ++i) {
      for (int j = i < m ? m : 0; j <= m; ++j) {
        const Number in_layer = first[i] * second[j] * power;
        for (int k = 0; k <= order - m; ++k)
          modes.push_back(Number(std::sqrt((2 * i + 1) * (2 * j + 1) * (2 * k + 2 * m + 3) / 8.0)) * in_layer *
                          third[k]);
      }
    }
  }
  return modes;
}

template <class Number>
std::vector<Number> modes_at(Shape shape, int order, const Coordinates<Number>& at) {
  const auto product = [](const std::vector<Number>& a, const std::vector<Number>& b) {
    std::vector<Number> all;
    for (const Number& x : a)
      for (const Number& y : b) all.push_back(x * y);
    return all;
  };
  const auto along = [&](int direction) { return line_modes<Number>(order, {at[direction], Number(0), Number(0)}); };
  switch (shape) {
    case Shape::Point:
      return {Number(1)};
    case Shape::Line:
      return along(0);
    case Shape::Triangle:
      return triangle_modes(order, at);
    case Shape::Quadrilateral:
      return product(along(0), along(1));
    case Shape::Tetrahedron:
      return tetrahedron_modes(order, at);
    case Shape::Pyramid:
      return pyramid_modes(order, at);
    case Shape::Prism:
      return product(triangle_modes(order, at), along(2));
    case Shape::Hexahedron:
      return product(product(along(0), along(1)), along(2));
  }
  assert(false && "a shape that is not in the table");
  return {};
}

}  // namespace

Eigen::MatrixXd modal_values(Shape shape, int order, const Points& at) {
  Eigen::MatrixXd values(at.rows(), node_count(shape, order));
  for (Eigen::Index p = 0; p < at.rows(); ++p) {
    Coordinates<double> x{};
    for (Eigen::Index c = 0; c < at.cols(); ++c) x[c] = at(p, c);
    const std::vector<double> modes = modes_at(shape, order, x);
    for (Eigen::Index m = 0; m < values.cols(); ++m) values(p, m) = modes[m];
  }
  return values;
}

std::vector<Eigen::MatrixXd> modal_gradients(Shape shape, int order, const Points& at) {
  std::vector<Eigen::MatrixXd> gradients(at.cols(), Eigen::MatrixXd(at.rows(), node_count(shape, order)));
  for (Eigen::Index p = 0; p < at.rows(); ++p) {
    assert((shape != Shape::Pyramid || at(p, 2) < 1) && "a pyramid's basis has no gradient at the apex");
    Coordinates<Dual> x{};
    for (Eigen::Index c = 0; c < at.cols(); ++c) x[c] = Dual::coordinate(at(p, c), static_cast<int>(c));
    const std::vector<Dual> modes = modes_at(shape, order, x);
    for (std::size_t c = 0; c < gradients.size(); ++c)
      for (Eigen::Index m = 0; m < gradients[c].cols(); ++m) gradients[c](p, m) = modes[m].gradient[c];
  }
  return gradients;
}

std::vector<int> modal_degrees(Shape shape, int order) {
  std::vector<int> line(order + 1), degrees;
  std::iota(line.begin(), line.end(), 0);
  const auto product = [](const std::vector<int>& a, const std::vector<int>& b) {
    std::vector<int> all;
    for (const int x : a)
      for (const int y : b) all.push_back(std::max(x, y));
    return all;
  };
  switch (shape) {
    case Shape::Point:
      return {0};
    case Shape::Line:
      return line;
    case Shape::Triangle:
      for (int i = 0; i <= order; ++i)
        for (int j = 0; i + j <= order; ++j) degrees.push_back(i + j);
      return degrees;
    case Shape::Quadrilateral:
      return product(line, line);
    case Shape::Tetrahedron:
      for (int i = 0; i <= order; ++i)
        for (int j = 0; i + j <= order; ++j)
          for (int k = 0; i + j + k <= order; ++k) degrees.push_back(i + j + k);
      return degrees;
    case Shape::Pyramid:
      for (int m = 0; m <= order; ++m)
        for (int in_layer = 0; in_layer < 2 * m + 1; ++in_layer)
          for (int k = 0; k <= order - m; ++k) degrees.push_back(m + k);
      return degrees;
    case Shape::Prism:
      return product(modal_degrees(Shape::Triangle, order), line);
    case Shape::Hexahedron:
      return product(product(line, line), line);
  }
  assert(false && "a shape that is not in the table");
  return {};
}

}  // namespace varimesh::reference
