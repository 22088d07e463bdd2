// Every energy's first and second derivatives against finite differences in quadruple precision, in 2-D and 3-D, for J
// positive, near zero and negative, and for δ from 1e-8 to 1e-1.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <string>

#include "core/energy/density-inl.h"
#include "core/energy/density.h"
#include "tests/core/energy/materials.h"
#include "tests/core/energy/quad.h"

namespace varimesh::HWY_NAMESPACE {
template <>
struct Constant<quad::Quad> {
  static quad::Quad of(double c) { return {c}; }
};
}  // namespace varimesh::HWY_NAMESPACE

namespace varimesh {
namespace {

using quad::Quad;

template <int d>
using QuadMatrix = HWY_NAMESPACE::Matrix<Quad, d>;

template <int d>
QuadMatrix<d> to_quad(const Eigen::Matrix<double, d, d>& F) {
  QuadMatrix<d> out;
  for (int i = 0; i < d; ++i)
    for (int j = 0; j < d; ++j) out[i][j] = {F(i, j)};
  return out;
}

/// A random matrix whose determinant is J.
template <int d>
Eigen::Matrix<double, d, d> with_determinant(double J, std::mt19937& random) {
  std::normal_distribution<double> normal;
  Eigen::Matrix<double, d, d> F;
  do {
    for (int i = 0; i < d * d; ++i) F(i / d, i % d) = normal(random);
  } while (std::abs(F.determinant()) < 0.3);
  // Choose the smallest singular value so that the determinant is J.
  Eigen::JacobiSVD<Eigen::Matrix<double, d, d>> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix<double, d, 1> sigma = svd.singularValues();
  const double sign = svd.matrixU().determinant() * svd.matrixV().determinant();
  double others = sign;
  for (int i = 0; i + 1 < d; ++i) others *= sigma[i];
  sigma[d - 1] = J / others;
  return svd.matrixU() * sigma.asDiagonal() * svd.matrixV().transpose();
}

/// Compares with differences of fourth order of W, evaluated in quadruple precision at the given F.
template <int d>
void expect_derivatives(const Material& material, const Eigen::Matrix<double, d, d>& F, double delta) {
  const Density<d> got = density<d>(material, F, delta * delta);
  const Quad delta_squared{static_cast<__float128>(delta * delta)};
  // The step is small against δ and |J|, over which the regularised Jacobian bends.
  const double bend = std::max(1e-12, std::hypot(delta, F.determinant()));
  const __float128 h = static_cast<__float128>(1e-4) * static_cast<__float128>(std::min(1.0, bend));
  const auto W = [&](const QuadMatrix<d>& at) {
    return HWY_NAMESPACE::with_energy<d>(
        material, [&](auto energy) { return HWY_NAMESPACE::density_value<d>(energy, at, delta_squared).v; });
  };
  const auto P = [&](const QuadMatrix<d>& at) {
    return HWY_NAMESPACE::with_energy<d>(
        material, [&](auto energy) { return HWY_NAMESPACE::density_gradient<d>(energy, at, delta_squared); });
  };
  const QuadMatrix<d> f = to_quad<d>(F);
  Eigen::Matrix<double, d * d, 1> gradient;
  Eigen::Matrix<double, d * d, d * d> hessian;
  for (int k = 0; k < d * d; ++k) {
    const auto shifted = [&](int steps) {
      QuadMatrix<d> at = f;
      at[k / d][k % d].v += steps * h;
      return at;
    };
    gradient[k] =
        static_cast<double>((8 * (W(shifted(1)) - W(shifted(-1))) - (W(shifted(2)) - W(shifted(-2)))) / (12 * h));
    const auto p1 = P(shifted(1)), m1 = P(shifted(-1)), p2 = P(shifted(2)), m2 = P(shifted(-2));
    for (int l = 0; l < d * d; ++l) {
      const int i = l / d, j = l % d;
      hessian(l, k) = static_cast<double>((8 * (p1[i][j].v - m1[i][j].v) - (p2[i][j].v - m2[i][j].v)) / (12 * h));
    }
  }
  EXPECT_LE((got.P - gradient).norm(), 1e-7 * gradient.norm() + 1e-12)
      << "J = " << F.determinant() << ", δ = " << delta;
  EXPECT_LE((got.H - hessian).norm(), 1e-7 * hessian.norm() + 1e-12) << "J = " << F.determinant() << ", δ = " << delta;
}

class EnergyDerivatives : public testing::TestWithParam<NamedMaterial> {};

TEST_P(EnergyDerivatives, MatchFiniteDifferencesIn2D) {
  std::mt19937 random(1);
  for (const double delta : {1e-8, 1e-6, 1e-4, 1e-2, 1e-1})
    for (const double J : {2.0, 0.5, 1e-2, 1e-4, 0.0, -1e-4, -1e-2, -0.5, -2.0})
      expect_derivatives<2>(GetParam().material, with_determinant<2>(J, random), delta);
}

TEST_P(EnergyDerivatives, MatchFiniteDifferencesIn3D) {
  std::mt19937 random(2);
  for (const double delta : {1e-8, 1e-6, 1e-4, 1e-2, 1e-1})
    for (const double J : {2.0, 0.5, 1e-2, 1e-4, 0.0, -1e-4, -1e-2, -0.5, -2.0})
      expect_derivatives<3>(GetParam().material, with_determinant<3>(J, random), delta);
}

TEST_P(EnergyDerivatives, MatchWithoutRegularisationIfJIsPositive) {
  std::mt19937 random(3);
  for (const double J : {3.0, 1.0, 0.1, 1e-3}) {
    expect_derivatives<2>(GetParam().material, with_determinant<2>(J, random), 0);
    expect_derivatives<3>(GetParam().material, with_determinant<3>(J, random), 0);
  }
}

INSTANTIATE_TEST_SUITE_P(Energies, EnergyDerivatives, testing::ValuesIn(every_material()),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace varimesh
