// The energy of cells: its gradient and products against differences, and its convex part.
#include "core/terms/cell_energy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/kernels/regularisation.h"
#include "core/options/options.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

class CellEnergyOn : public ::testing::TestWithParam<Filling> {
 protected:
  /// @param shake  how far each node is moved; .3 turns cells over
  void prepare(double shake) {
    HighOrderMesh mesh = testing::grid(GetParam(), {3, 3, 2}, 2, testing::bent(testing::is_plane(GetParam()) ? 2 : 3));
    testing::shake(mesh, shake, 7);
    problem_ = testing::make_problem(mesh);
    kernels_ = make_kernels(material_, problem_.dimension);
    hessian_ = make_hessian_kernels(material_, problem_.dimension);
    for (CellSet& set : problem_.sets) set.delta_squared.assign(static_cast<std::size_t>(set.count), 0.25);
  }
  std::size_t unknowns() const { return problem_.free.size() * static_cast<std::size_t>(problem_.dimension); }
  void move(const std::vector<double>& direction, double by) {
    const auto d = static_cast<std::size_t>(problem_.dimension);
    for (std::size_t f = 0; f < problem_.free.size(); ++f)
      for (std::size_t k = 0; k < d; ++k)
        problem_.positions[static_cast<std::size_t>(problem_.free[f]) * d + k] += by * direction[f * d + k];
  }

  const Material material_ = material(Options{});
  Problem problem_;
  std::unique_ptr<Kernels> kernels_;
  std::unique_ptr<HessianKernels> hessian_;
  Team team_{2};
};

INSTANTIATE_TEST_SUITE_P(Fillings, CellEnergyOn, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return testing::name(info.param); });

TEST_P(CellEnergyOn, GradientsAndProductsAreThoseOfDifferences) {
  for (const double p : {1.0, 2.0}) {
    prepare(0.05);
    team_.run([&] {
      CellEnergy energy(problem_, *kernels_, *hessian_, PNorm{p}, team_);
      const std::vector<double> direction = testing::random_direction(problem_, 3);
      const auto at = [&](double by, std::vector<double>& gradient) {
        move(direction, by);
        energy.gradient(gradient);
        move(direction, -by);
        return energy.value();
      };
      std::vector<double> gradient(unknowns()), before(unknowns()), after(unknowns());
      energy.fit_scale();
      energy.linearise(gradient);
      const auto zeros = static_cast<std::size_t>(padded(problem_.dimension));
      std::vector<float> of_direction(direction.begin(), direction.end()), product(unknowns() + zeros);
      of_direction.resize(unknowns() + zeros);
      const double curvature = energy.multiply(of_direction, product) * energy.scale();
      constexpr double kBy = 1e-3;
      const double difference = (at(kBy, after) - at(-kBy, before)) / (2 * kBy);
      double slope = 0, size = 0, second = 0;
      for (std::size_t i = 0; i < unknowns(); ++i) {
        slope += gradient[i] * direction[i];
        size += std::abs(gradient[i] * direction[i]);
        second += (after[i] - before[i]) / (2 * kBy) * direction[i];
      }
      EXPECT_NEAR(difference, slope, 1e-5 * size);
      EXPECT_NEAR(curvature, second, 1e-3 * std::abs(second));
    });
  }
}

TEST_P(CellEnergyOn, WeightsMultiplyEachCell) {
  prepare(0.05);
  team_.run([&] {
    CellEnergy energy(problem_, *kernels_, *hessian_, PNorm{}, team_);
    std::vector<double> gradient(unknowns()), weighted(unknowns());
    energy.gradient(gradient);
    const double value = energy.value();
    const std::vector<double> weights(static_cast<std::size_t>(problem_.cells), 3);
    energy.weigh(weights, 2);
    energy.gradient(weighted);
    EXPECT_NEAR(energy.value(), 1.5 * value, 1e-12 * value);
    for (std::size_t i = 0; i < unknowns(); ++i)
      EXPECT_NEAR(weighted[i], 1.5 * gradient[i], 1e-9 * (1 + std::abs(gradient[i])));
  });
}

TEST_P(CellEnergyOn, ConvexPartHasNoNegativeCurvature) {
  prepare(0.3);
  team_.run([&] {
    CellEnergy energy(problem_, *kernels_, *hessian_, PNorm{}, team_);
    std::vector<double> gradient(unknowns());
    energy.linearise(gradient);
    const auto zeros = static_cast<std::size_t>(padded(problem_.dimension));
    std::vector<float> direction(unknowns() + zeros), product(unknowns() + zeros);
    // Multiplying a direction again and again, with a shift, brings out the lowest curvature.
    const auto lowest = [&] {
      std::mt19937 random(5);
      std::normal_distribution<float> normal;
      for (std::size_t i = 0; i < unknowns(); ++i) direction[i] = normal(random);
      double largest = 0, curvature = 0;
      for (int k = 0; k < 200; ++k) {
        double size = 0;
        for (std::size_t i = 0; i < unknowns(); ++i) size += double(direction[i]) * double(direction[i]);
        for (float& one : direction) one /= static_cast<float>(std::sqrt(size));
        curvature = energy.multiply(direction, product);
        double length = 0;
        for (std::size_t i = 0; i < unknowns(); ++i) length += double(product[i]) * double(product[i]);
        largest = std::max(largest, std::sqrt(length));
        for (std::size_t i = 0; i < unknowns(); ++i)
          direction[i] = k < 50 ? product[i] : static_cast<float>(1.05 * largest) * direction[i] - product[i];
      }
      return curvature / largest;
    };
    EXPECT_LT(lowest(), -1e-3);
    energy.keep_convex_part(material_);
    EXPECT_GT(lowest(), -1e-5);
  });
}

}  // namespace
}  // namespace varimesh
