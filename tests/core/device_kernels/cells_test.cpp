// The kernels of a device, run by the processor, against the vectorised and the plain kernels.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/device/cpu_device.h"
#include "core/device_kernels/cells_on_device.h"
#include "core/kernels/node_star.h"
#include "core/kernels/p_norm.h"
#include "core/problem/target_field.h"
#include "core/problem/targets.h"
#include "core/terms/cell_energy.h"
#include "tests/core/energy/materials.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using device::CellsOnDevice;

struct Case {
  NamedMaterial material;
  int order;
};
void PrintTo(const Case& one, std::ostream* out) { *out << one.material.name << one.order; }

std::vector<Case> every_case() {
  std::vector<Case> cases;
  for (const NamedMaterial& material : every_material())
    for (const int order : {2, 3, 4, 5}) cases.push_back({material, order});
  return cases;
}

/// What is done to a mesh before it is handed to the kernels.
struct Treatment {
  const char* name;
  double shake;  ///< How far nodes are moved at random.
  double delta;  ///< δ² of every cell.
  bool metric;   ///< Whether the target has a metric, with a left factor.
  double norm;   ///< p of the p-norm.
};
constexpr Treatment kTreatments[] = {{"valid", 0.15, 0, false, 1},
                                     {"tangled", 2, 0.25, false, 1},
                                     {"metric", 0.15, 0, true, 1},
                                     {"norm", 0.15, 0, false, 3}};

class DeviceCells : public ::testing::TestWithParam<Case> {
 protected:
  /// A grid of 48 or 60 tetrahedra: three full batches, or three and a part.
  void prepare(const Treatment& treatment, std::array<int, 3> counts) {
    HighOrderMesh mesh = testing::grid(testing::Filling::Tetrahedra, counts, GetParam().order, testing::bent(3));
    testing::shake(mesh, treatment.shake / std::pow(GetParam().order, 3), 7);
    problem_ = testing::make_problem(mesh);
    if (treatment.metric) set_metric(mesh);
    CellSet& set = problem_.sets.front();
    set.delta_squared.assign(static_cast<std::size_t>(set.count), treatment.delta);
    fast_ = make_kernels(GetParam().material.material, 3);
    plain_ = make_plain_kernels(GetParam().material.material, 3);
    hessian_ = make_hessian_kernels(GetParam().material.material, 3);
  }
  void set_metric(const HighOrderMesh& mesh) {
    Options options;
    options.target = Target::Size;
    options.target_field = {Per::Cell, 6, {}, {}};
    for (std::int32_t cell = 0; cell < problem_.cells; ++cell)
      for (const double entry : {8.0, 11.0, 40.0, -3.0, 9.0, 14.0})
        options.target_field.values.push_back((1 + 0.01 * cell) * entry);
    const auto field = resolve_target_field(mesh, options);
    ASSERT_TRUE(field) << field.error().sentence;
    set_targets(problem_, *field, frame_of(mesh).diagonal);
    ASSERT_FALSE(problem_.sets.front().left_factor.empty());
  }
  std::size_t unknowns() const { return problem_.free.size() * 3; }

  Problem problem_;
  std::unique_ptr<Kernels> fast_, plain_;
  std::unique_ptr<HessianKernels> hessian_;
  std::unique_ptr<device::Device> cpu_ = device::make_cpu_device();
};

INSTANTIATE_TEST_SUITE_P(Materials, DeviceCells, ::testing::ValuesIn(every_case()),
                         [](const auto& info) { return info.param.material.name + std::to_string(info.param.order); });

double largest(std::span<const double> numbers) {
  double largest = 0;
  for (const double one : numbers) largest = std::max(largest, std::abs(one));
  return largest;
}

TEST_P(DeviceCells, EnergiesAreThoseOfThePlainKernels) {
  for (const Treatment& treatment : kTreatments)
    for (const std::array<int, 3> counts : {std::array{2, 2, 1}, std::array{5, 1, 1}}) {
      SCOPED_TRACE(treatment.name);
      prepare(treatment, counts);
      const CellSet& set = problem_.sets.front();
      const auto cells = CellsOnDevice::make(*cpu_, problem_, GetParam().material.material);
      ASSERT_TRUE(cells) << cells.error().sentence;
      const auto scans = (*cells)->scan();
      ASSERT_TRUE(scans);
      ASSERT_EQ(scans->size(), static_cast<std::size_t>(set.count));
      for (std::int32_t cell = 0; cell < set.count; ++cell) {
        AlignedVector<double> F(set.deformation_size());
        plain_->deform(set, cell, problem_.positions, F.data());
        const CellScan plain = plain_->scan(set, cell, F.data(), nullptr);
        ASSERT_TRUE(treatment.delta > 0 || plain.smallest_jacobian > 0);
        const CellScan& ours = (*scans)[static_cast<std::size_t>(cell)];
        EXPECT_NEAR(ours.energy, plain.energy, 1e-14 * (std::abs(plain.energy) + cell_measure(set, cell)));
        EXPECT_NEAR(ours.smallest_jacobian, plain.smallest_jacobian, 1e-13 * std::max(1.0, std::pow(largest(F), 3)));
        EXPECT_NEAR(ours.scaled_jacobian, plain.scaled_jacobian, 1e-13);
      }
    }
}

// The gradient by the core's own kernels, whose contributions have 48 bits too.
TEST_P(DeviceCells, GradientsAndProductsAreThoseOfTheVectorisedKernels) {
  for (const Treatment& treatment : kTreatments)
    for (const std::array<int, 3> counts : {std::array{2, 2, 1}, std::array{5, 1, 1}}) {
      SCOPED_TRACE(treatment.name);
      prepare(treatment, counts);
      const Team team(1);
      const PNorm norm{treatment.norm};
      CellEnergy energy(problem_, *fast_, *hessian_, PNorm{}, team);
      std::vector<double> theirs(unknowns()), ours(unknowns()), again(unknowns());
      std::vector<float> direction, their_product(unknowns() + 4), our_product(unknowns());
      for (const double component : testing::random_direction(problem_, 3))
        direction.push_back(static_cast<float>(component));
      std::vector<float> padded_direction = direction;
      padded_direction.resize(unknowns() + 4);
      double their_along = 0;
      std::vector<double> weights;
      team.run([&] {
        energy.scan();
        for (std::int32_t cell = 0; cell < problem_.cells; ++cell)
          weights.push_back(norm.slope(energy.scans()[static_cast<std::size_t>(cell)].energy,
                                       cell_measure(problem_.sets.front(), cell)));
        energy.weigh(weights, 1);
        energy.linearise(theirs);
        their_along = energy.multiply(padded_direction, their_product);
      });
      problem_.sets.front().energy_slope = weights;
      const auto cells = CellsOnDevice::make(*cpu_, problem_, GetParam().material.material);
      ASSERT_TRUE(cells) << cells.error().sentence;
      ASSERT_TRUE((*cells)->gradient(ours));
      ASSERT_TRUE((*cells)->linearise(again));
      EXPECT_EQ(ours, again) << "linearise() has the bits of gradient()";
      // The cells' contributions may cancel, so they are what the differences are compared with.
      std::vector<float> contributions((*cells)->contributions().bytes() / sizeof(float));
      ASSERT_TRUE((*cells)->contributions().download<float>(contributions));
      double size = 0;
      for (const float one : contributions) size = std::max(size, std::abs(static_cast<double>(one)));
      for (std::size_t i = 0; i < unknowns(); ++i) EXPECT_NEAR(ours[i], theirs[i], 1e-13 * size);
      const auto along = (*cells)->multiply(direction, our_product);
      ASSERT_TRUE(along);
      double most = 0;
      for (std::size_t i = 0; i < unknowns(); ++i) most = std::max(most, std::abs(double(their_product[i])));
      for (std::size_t i = 0; i < unknowns(); ++i) EXPECT_NEAR(our_product[i], their_product[i], 1e-5 * most);
      EXPECT_NEAR(*along, their_along, 1e-5 * std::abs(their_along));
    }
}

// What the vectorised kernels have linearised a device can multiply, and the other way round.
TEST_P(DeviceCells, KeepsWhatTheVectorisedKernelsKeep) {
  prepare(kTreatments[0], {5, 1, 1});
  CellSet& set = problem_.sets.front();
  std::vector<BatchSet> batches = make_batches(problem_, *hessian_);
  BatchSet& batch = batches.front();
  for (std::int32_t b = 0; b < batch.count; ++b) {
    AlignedVector<double> F(kBatch * set.deformation_size());
    for (std::int32_t cell = b * kBatch; cell < std::min(set.count, (b + 1) * kBatch); ++cell)
      fast_->deform(set, cell, problem_.positions,
                    F.data() + static_cast<std::size_t>(cell - b * kBatch) * set.deformation_size());
    hessian_->linearise(batch, b, F.data());
  }
  const auto cells = CellsOnDevice::make(*cpu_, problem_, GetParam().material.material);
  ASSERT_TRUE(cells);
  std::vector<double> gradient(unknowns());
  ASSERT_TRUE((*cells)->linearise(gradient));
  std::vector<float> linearisation(batch.linearisation.size()), mean(batch.mean.size());
  std::vector<std::int16_t> steps(batch.deformation.size());
  ASSERT_EQ((*cells)->linearisation().bytes(), linearisation.size() * sizeof(float));
  ASSERT_TRUE((*cells)->linearisation().download<float>(linearisation));
  ASSERT_TRUE((*cells)->mean().download<float>(mean));
  ASSERT_TRUE((*cells)->deformation().download<std::int16_t>(steps));
  // Partial derivatives of one kind stand at the same place of each point.
  const auto entries = static_cast<std::size_t>(batch.entries);
  std::vector<double> size(entries);
  for (std::size_t i = 0; i < linearisation.size(); ++i) {
    double& of_kind = size[i / kBatch % entries];
    of_kind = std::max(of_kind, std::abs(double(batch.linearisation[i])));
  }
  for (std::size_t i = 0; i < linearisation.size(); ++i)
    ASSERT_NEAR(linearisation[i], batch.linearisation[i], 2e-7 * size[i / kBatch % entries]) << i;
  for (std::size_t i = 0; i < mean.size(); ++i) ASSERT_NEAR(mean[i], batch.mean[i], 1e-6) << i;
  std::size_t other = 0;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    ASSERT_LE(std::abs(steps[i] - batch.deformation[i]), 1) << i;
    other += steps[i] != batch.deformation[i] ? 1 : 0;
  }
  EXPECT_LE(other, steps.size() / 50);
}

TEST(MemoryOnADevice, IsLessThanFourKibibytesPerQuarticTetrahedron) {
  const HighOrderMesh mesh = testing::grid(testing::Filling::Tetrahedra, {6, 6, 6}, 4, testing::bent(3));
  Problem problem = testing::make_problem(mesh);
  for (CellSet& set : problem.sets) set.delta_squared.assign(static_cast<std::size_t>(set.count), 0.25);
  const auto cpu = device::make_cpu_device();
  const auto cells = CellsOnDevice::make(*cpu, problem, material(Options{}));
  ASSERT_TRUE(cells);
  const double per_cell = static_cast<double>((*cells)->memory()) / problem.cells;
  RecordProperty("bytes", std::to_string(per_cell));
  EXPECT_LT(per_cell, 4096);
  EXPECT_GT(per_cell, 2048) << "something is not counted";
}

}  // namespace
}  // namespace varimesh
