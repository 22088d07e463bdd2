// The operations that the kernels are said to make, against those that they make: the kernels are compiled once more,
// for lanes that count.
#include "core/kernels/operations.h"

#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "core/kernels/hessian/operations.h"
#include "core/solvers/newton/newton.h"
#include "core/solvers/sweeps/sweep.h"
#include "tests/core/energy/materials.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"
// After all others, since it takes the place of Highway.
#include "tests/core/support/counted_lanes.h"
// Compiled for it.
#include "core/kernels/hessian/hessian-inl.h"
#include "core/kernels/kernels-inl.h"

namespace varimesh {
namespace {

using testing::Filling;
namespace counted = HWY_NAMESPACE;

/// Operations of one call.
template <class Call>
double count(const Call& call) {
  const std::int64_t before = hwy::HWY_NAMESPACE::operations;
  call();
  return static_cast<double>(hwy::HWY_NAMESPACE::operations - before);
}

struct Case {
  NamedMaterial material;
  int dimension;
};

std::vector<Case> every_case() {
  std::vector<Case> cases;
  for (const NamedMaterial& material : every_material())
    for (const int dimension : {2, 3}) cases.push_back({material, dimension});
  return cases;
}

class KernelOperations : public ::testing::TestWithParam<Case> {
 protected:
  KernelOperations() {
    const Filling filling = d_ == 2 ? Filling::Triangles : Filling::Tetrahedra;
    problem_ = testing::make_problem(testing::grid(filling, cells_, 3, testing::bent(d_)));
    const auto make = [&]<int d>(std::integral_constant<int, d>) {
      kernels_.reset(counted::new_kernels<d>(GetParam().material.material));
      hessian_.reset(counted::new_hessian_kernels<d>(GetParam().material.material));
    };
    if (d_ == 2)
      make(std::integral_constant<int, 2>());
    else
      make(std::integral_constant<int, 3>());
    hold_deformation(problem_, kernels_->keeps_function());
    for (std::int32_t cell = 0; cell < set().count; ++cell) kernels_->rebuild(set(), cell, problem_.positions);
  }

  CellSet& set() { return problem_.sets[0]; }
  /// The kernels of the sweeps work on the points with their padding.
  double padding() { return static_cast<double>(set().stride) / set().points; }

  const int d_ = GetParam().dimension;
  /// Boxes of the grid. Its 128 triangles or 192 tetrahedra fill their batches.
  const std::array<int, 3> cells_ = d_ == 2 ? std::array<int, 3>{8, 8, 1} : std::array<int, 3>{4, 4, 1};
  const PointOperations& point_ = point_operations(GetParam().material.material, d_);
  std::unique_ptr<Kernels> kernels_;
  std::unique_ptr<HessianKernels> hessian_;
  Problem problem_;
};

INSTANTIATE_TEST_SUITE_P(Energies, KernelOperations, ::testing::ValuesIn(every_case()), [](const auto& info) {
  return info.param.material.name + std::to_string(info.param.dimension) + "D";
});

TEST_P(KernelOperations, OfAVisit) {
  ASSERT_EQ(problem_.sets.size(), 1u);
  std::vector<double> scratch(NodeStar::kMostNumbers);
  const std::int32_t rank = static_cast<std::int32_t>(problem_.free.size()) / 2;
  NodeStar star(problem_, rank, kernels_->line_size(), scratch.data());
  const double points = static_cast<double>(star.cells().size()) * set().stride;
  const double step[3] = {1e-6, 2e-6, -1e-6};
  EXPECT_EQ(count([&] { kernels_->expand(star.cells()); }), points * point_.expand);
  // |step|² is computed once per cell, and not counted.
  const double once = 2 * d_ - 1, trial = count([&] { kernels_->energy_after(star.cells(), step); });
  EXPECT_GE(trial, points * point_.energy_after);
  EXPECT_LE(trial, points * point_.energy_after + once * static_cast<double>(star.cells().size()));
  EXPECT_EQ(count([&] { kernels_->move(star.cells(), step); }), points * point_.move);
}

TEST_P(KernelOperations, OfAScan) {
  std::vector<double> deformation(set().deformation_size());
  EXPECT_EQ(count([&] { kernels_->deform(set(), 1, problem_.positions, deformation.data()); }),
            deform_operations(set()) * padding());
  EXPECT_EQ(count([&] {
              kernels_->deform(set(), 1, problem_.positions, deformation.data());
              kernels_->scan(set(), 1, deformation.data(), nullptr);
            }),
            scan_operations(set(), point_) * padding());
}

TEST_P(KernelOperations, OfTheHessian) {
  std::vector<BatchSet> batches = make_batches(problem_, *hessian_);
  BatchSet& batch = batches[0];
  ASSERT_GE(set().count, kBatch);
  EXPECT_EQ(count([&] { hessian_->linearise(batch, 0, set().deformation_of(0)); }),
            kBatch * gradient_operations(set(), point_) * padding());
  EXPECT_EQ(count([&] { hessian_->gradient(batch, 0, set().deformation_of(0)); }),
            kBatch * gradient_operations(set(), point_) * padding());
  EXPECT_EQ(count([&] { hessian_->node_blocks(batch, 0); }), kBatch * block_operations(set(), point_));
  std::vector<float> direction(problem_.free.size() * d_ + padded(d_), 0.5F);
  EXPECT_EQ(count([&] { hessian_->apply(batch, 0, direction); }), kBatch * product_operations(batch, point_));
}

/// What a meter is told, and what was counted.
struct Both {
  double told, counted;
};

TEST_P(KernelOperations, OfASweepAreTold) {
  const ColouredNodes coloured = colour_nodes(problem_, Colouring::Group);
  const Team team(1);
  WorkMeter meter([](const Work&) {});
  Sweeper sweeper(problem_, coloured, *kernels_, Regularisation::Element, PNorm{}, 0, team);
  sweeper.count_with(&meter, point_);
  const auto measure = [&](const auto& work) {
    const double before = meter.kernels().operations;
    const double made = count(work);
    return Both{(meter.kernels().operations - before) * padding(), made};
  };
  const Both rebuilt = measure([&] { sweeper.rebuild(); });
  EXPECT_GT(rebuilt.told, 0);
  EXPECT_NEAR(rebuilt.counted, rebuilt.told, 1e-9 * rebuilt.told);
  const Both scanned = measure([&] { sweeper.scan(); });
  EXPECT_GT(scanned.told, 0);
  EXPECT_NEAR(scanned.counted, scanned.told, 1e-9 * scanned.told);
  // The second sweep leaves out what has come to rest, and its line searches take other numbers of steps.
  for (int i = 0; i < 3; ++i) {
    const Both swept = measure([&] { sweeper.sweep(); });
    EXPECT_GT(swept.told, 0);
    EXPECT_NEAR(swept.counted, swept.told, 0.01 * swept.told) << "sweep " << i;
  }
  EXPECT_GT(meter.kernels().seconds, 0);
}

TEST_P(KernelOperations, OfANewtonStepAreTold) {
  const Team team(1);
  WorkMeter meter([](const Work&) {});
  Newton newton(problem_, *kernels_, *hessian_, PNorm{}, 1e-6, team);
  newton.count_with(&meter, point_);
  const double made = count([&] { newton.step(); });
  const double told = meter.kernels().operations;
  // The preconditioner's share, the sums over the cells of a node and the padding are not told.
  EXPECT_GE(made, told);
  EXPECT_LE(made, 1.4 * told);
  EXPECT_GT(meter.kernels().seconds, 0);
}

}  // namespace
}  // namespace varimesh
