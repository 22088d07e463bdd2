// Calls the templates of density-inl.h for the energy of a material.
#include "core/energy/density.h"

#include "core/energy/density-inl.h"

namespace varimesh {
namespace {

template <int d>
HWY_NAMESPACE::Matrix<double, d> entries(const Eigen::Matrix<double, d, d>& F) {
  HWY_NAMESPACE::Matrix<double, d> out;
  for (int i = 0; i < d; ++i)
    for (int j = 0; j < d; ++j) out[i][j] = F(i, j);
  return out;
}

}  // namespace

template <int d>
double energy_density(const Material& material, const Eigen::Matrix<double, d, d>& F, double delta_squared) {
  return HWY_NAMESPACE::with_energy<d>(
      material, [&](auto energy) { return HWY_NAMESPACE::density_value<d>(energy, entries<d>(F), delta_squared); });
}

template <int d>
Density<d> density(const Material& material, const Eigen::Matrix<double, d, d>& F, double delta_squared) {
  return HWY_NAMESPACE::with_energy<d>(material, [&](auto energy) {
    const HWY_NAMESPACE::Matrix<double, d> f = entries<d>(F);
    Density<d> out;
    out.W = HWY_NAMESPACE::density_value<d>(energy, f, delta_squared);
    const auto P = HWY_NAMESPACE::density_gradient<d>(energy, f, delta_squared);
    for (int k = 0; k < d * d; ++k) {
      out.P(k) = P[k / d][k % d];
      HWY_NAMESPACE::Matrix<double, d> direction{};
      direction[k / d][k % d] = 1;
      const auto column = HWY_NAMESPACE::density_hessian_times<d>(energy, f, delta_squared, direction);
      for (int l = 0; l < d * d; ++l) out.H(l, k) = column[l / d][l % d];
    }
    return out;
  });
}

template double energy_density<2>(const Material&, const Eigen::Matrix2d&, double);
template double energy_density<3>(const Material&, const Eigen::Matrix3d&, double);
template Density<2> density<2>(const Material&, const Eigen::Matrix2d&, double);
template Density<3> density<3>(const Material&, const Eigen::Matrix3d&, double);

}  // namespace varimesh
