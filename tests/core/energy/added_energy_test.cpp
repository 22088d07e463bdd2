// An energy of one file, as docs/extending.md describes it, works with the kernels of the sweeps and of Newton's method
// without changes to them.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "core/energy/density-inl.h"
#include "core/kernels/hessian/hessian-inl.h"
#include "core/kernels/kernels-inl.h"
#include "core/solvers/sweeps/sweep.h"
#include "tests/core/energy/added_energy-inl.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

template <int d>
using Added = HWY_NAMESPACE::AddedEnergy<d>;

/// A mesh with the kernels that are compiled for the added energy.
template <int d>
struct Setup {
  explicit Setup(double shaken) {
    HighOrderMesh mesh =
        testing::grid(d == 2 ? Filling::Triangles : Filling::Tetrahedra, {3, 2, 2}, 3, testing::bent(d));
    testing::shake(mesh, shaken, 7);
    problem = testing::make_problem(mesh);
    coloured = colour_nodes(problem, Colouring::Group);
    sweeper.emplace(problem, coloured, kernels, Regularisation::Element, PNorm{}, -1.0, team);
    sweeper->rebuild();
  }

  HWY_NAMESPACE::VectorKernels<Added<d>, d> kernels{Added<d>(Material{})};
  HWY_NAMESPACE::VectorHessian<Added<d>, d> hessian{Added<d>(Material{})};
  Problem problem;
  ColouredNodes coloured;
  Team team{1};
  std::optional<Sweeper> sweeper;
};

template <int d>
void expect_the_kernels_to_agree() {
  Setup<d> setup(0.01);
  ASSERT_EQ(setup.sweeper->scan().invalid, 0);
  testing::WholeMesh whole(setup.problem, setup.kernels);
  const std::vector<double> direction = testing::random_direction(setup.problem, 11);
  const double h = 1e-4;

  // The density at the points against the kernels: the energy of the mesh as it is.
  double energy = 0;
  for (const CellSet& set : setup.problem.sets)
    for (std::int32_t cell = 0; cell < set.count; ++cell)
      for (int q = 0; q < set.points; ++q) {
        HWY_NAMESPACE::Matrix<double, d> F;
        for (int entry = 0; entry < d * d; ++entry)
          F[entry / d][entry % d] = set.deformation_of(cell)[entry * set.stride + q];
        energy += set.weights[q] * set.measure_of(cell)[0] * HWY_NAMESPACE::density_value<d>(Added<d>({}), F, 0.0);
      }
  EXPECT_NEAR(whole.energy(direction, 0), energy, 1e-12 * std::abs(energy));

  // The gradient against differences of the energy, and products of the Hessian against differences of the gradient.
  const double difference = (whole.energy(direction, h) - whole.energy(direction, -h)) / (2 * h);
  const std::vector<double> gradient = whole.gradient(setup.kernels);
  const std::vector<double> product = whole.product(setup.hessian, direction);
  const std::vector<double> before = whole.gradient_at(direction, -h, setup.kernels);
  const std::vector<double> after = whole.gradient_at(direction, h, setup.kernels);
  double slope = 0, error = 0, size = 0;
  for (std::size_t i = 0; i < gradient.size(); ++i) {
    slope += gradient[i] * direction[i];
    error += std::pow(product[i] - (after[i] - before[i]) / (2 * h), 2);
    size += std::pow(product[i], 2);
  }
  EXPECT_NEAR(slope, difference, 1e-5 * std::abs(slope));
  EXPECT_LE(std::sqrt(error), 1e-3 * std::sqrt(size));
}

template <int d>
void expect_sweeps_to_untangle() {
  Setup<d> setup(0.12);
  ScanOutcome now = setup.sweeper->scan();
  ASSERT_GT(now.invalid, 0);
  for (int sweep = 0; sweep < 60 && now.invalid > 0; ++sweep) {
    setup.sweeper->sweep();
    now = setup.sweeper->scan();
  }
  EXPECT_EQ(now.invalid, 0);
}

TEST(AddedEnergy, ServesTheKernelsIn2D) { expect_the_kernels_to_agree<2>(); }
TEST(AddedEnergy, ServesTheKernelsIn3D) { expect_the_kernels_to_agree<3>(); }
TEST(AddedEnergy, UntanglesAMeshIn2D) { expect_sweeps_to_untangle<2>(); }
TEST(AddedEnergy, UntanglesAMeshIn3D) { expect_sweeps_to_untangle<3>(); }

}  // namespace
}  // namespace varimesh
