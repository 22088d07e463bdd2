// The energies' values against the paper's formulas written out, and their known gradients at F = 1.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "core/energy/density.h"
#include "tests/core/energy/materials.h"

namespace varimesh {
namespace {

Eigen::Matrix3d some_deformation() {
  Eigen::Matrix3d F;
  F << 1.1, 0.2, -0.1, 0.05, 0.9, 0.3, -0.2, 0.1, 1.2;
  return F;
}

const Material& named(const std::string& name) {
  static const std::vector<NamedMaterial> all = every_material();
  for (const NamedMaterial& entry : all)
    if (entry.name == name) return entry.material;
  throw std::logic_error("no material " + name);
}

TEST(EnergyDensity, Hyperelastic) {
  const Eigen::Matrix3d F = some_deformation();
  const double L = std::log(F.determinant()), mu = 1 / 2.8, lambda = 1 / 0.6;
  EXPECT_NEAR(energy_density<3>(named("Hyperelastic"), F, 0),
              mu / 2 * (F.squaredNorm() - 3) - mu * L + lambda / 2 * L * L, 1e-15);
}

TEST(EnergyDensity, LinearElastic) {
  const Eigen::Matrix3d F = some_deformation(), one = Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d small = (F + F.transpose()) / 2 - one, green = (F.transpose() * F - one) / 2;
  const double L = std::log(F.determinant()), mu = 1 / 2.8, bulk = 1 / 0.6;
  EXPECT_NEAR(energy_density<3>(named("SmallLog"), F, 0), mu * small.squaredNorm() + bulk / 2 * L * L, 1e-15);
  EXPECT_NEAR(energy_density<3>(named("GreenLagrangeLog"), F, 0), mu * green.squaredNorm() + bulk / 2 * L * L, 1e-15);
  EXPECT_NEAR(energy_density<3>(named("SmallTrace"), F, 0),
              mu * small.squaredNorm() + bulk / 2 * std::pow(small.trace(), 2), 1e-15);
  EXPECT_NEAR(energy_density<3>(named("GreenLagrangeTrace"), F, 0),
              mu * green.squaredNorm() + bulk / 2 * std::pow(green.trace(), 2), 1e-15);
}

TEST(EnergyDensity, WinslowAndDistortion) {
  const Eigen::Matrix3d F = some_deformation();
  const double J = F.determinant();
  const Eigen::Matrix3d cofactor = J * F.inverse().transpose();
  EXPECT_NEAR(energy_density<3>(named("WinslowTrue"), F, 0), cofactor.squaredNorm() / J, 1e-14);
  EXPECT_NEAR(energy_density<3>(named("WinslowPaper"), F, 0), F.squaredNorm() / J, 1e-14);
  EXPECT_NEAR(energy_density<3>(named("Distortion"), F, 0), F.squaredNorm() / (3 * std::pow(J, 2.0 / 3)), 1e-14);
}

TEST(EnergyDensity, AnUndeformedMeshIsStationary) {
  // With a fixed boundary, F = 1 everywhere is stationary if P(1) is a multiple of the identity, since ∫ div δu = 0.
  // P(1) is 0 except for Winslow's energies in 3-D: |cof F|²/J grows with a uniform scaling, and |F|²/J falls.
  for (const NamedMaterial& entry : every_material()) {
    const Material& m = entry.material;
    EXPECT_LE(density<2>(m, Eigen::Matrix2d::Identity(), 0).P.norm(), 1e-14) << entry.name;
    const double pressure = entry.name == "WinslowTrue" ? 1 : entry.name == "WinslowPaper" ? -1 : 0;
    const Eigen::Matrix<double, 9, 1> P = density<3>(m, Eigen::Matrix3d::Identity(), 0).P;
    Eigen::Matrix<double, 9, 1> expected = Eigen::Matrix<double, 9, 1>::Zero();
    for (const int diagonal : {0, 4, 8}) expected[diagonal] = pressure;
    EXPECT_LE((P - expected).norm(), 1e-14) << entry.name;
  }
}

TEST(EnergyDensity, TheRegularisedJacobianDoesNotCancel) {
  // In floating point J + √(J² + δ²) is 0 here, and its logarithm is −∞. To first order J' is δ²/(4 |J|).
  const double delta = 1e-8;
  const Eigen::Matrix2d F = Eigen::Vector2d(1, -1).asDiagonal();
  const double W = energy_density<2>(named("Hyperelastic"), F, delta * delta);
  const double L = std::log(delta * delta / 4), mu = 1 / 2.8, lambda = 1 / 0.6;
  EXPECT_NEAR(W, -mu * L + lambda / 2 * L * L, 1e-9 * W);
}

}  // namespace
}  // namespace varimesh
