// The kernels of a device, run by the processor, against the vectorised and the plain kernels.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/device/cpu_device.h"
#include "core/device_kernels/cells_on_device.h"
#include "core/device_kernels/split_cells.h"
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
  testing::Filling filling;
  int order;
};
std::string name_of(const Case& one) {
  return one.material.name + testing::name(one.filling) + std::to_string(one.order);
}
void PrintTo(const Case& one, std::ostream* out) { *out << name_of(one); }

/// With the hyperelastic energy, simplices of orders 2 to 5 and quadrilaterals, prisms and hexahedra of orders 2 to 4
/// have kernels of their own. All others share theirs.
std::vector<Case> every_case() {
  using enum testing::Filling;
  std::vector<Case> cases;
  for (const NamedMaterial& material : every_material()) {
    for (const int order : {2, 3}) cases.push_back({material, Tetrahedra, order});
    for (const auto filling : {Quadrilaterals, Triangles, MixedPlane, Hexahedra, Prisms, Pyramids, MixedSolid})
      for (const int order : {2, 3})
        if (filling != Pyramids || order == 2) cases.push_back({material, filling, order});
  }
  const NamedMaterial hyperelastic = every_material().front();
  for (const int order : {4, 5, 6})
    for (const auto filling : {Tetrahedra, Triangles}) cases.push_back({hyperelastic, filling, order});
  for (const auto filling : {Quadrilaterals, Prisms, Hexahedra}) cases.push_back({hyperelastic, filling, 4});
  cases.push_back({hyperelastic, Triangles, 8});
  return cases;
}

enum class Metric { None, OfCells, Varies };

/// What is done to a mesh before it is handed to the kernels.
struct Treatment {
  const char* name;
  double shake;  ///< How far nodes are moved at random, times the order cubed.
  double delta;  ///< δ² of every cell.
  Metric metric;
  double norm;   ///< p of the p-norm.
  int more = 0;  ///< By how much the degree of the quadrature is above 2 P.
};
constexpr Treatment kTreatments[] = {
    {"valid", 0.15, 0, Metric::None, 1},     {"tangled", 2, 0.25, Metric::None, 1},
    {"metric", 0.15, 0, Metric::OfCells, 1}, {"varying metric", 0.15, 0, Metric::Varies, 1},
    {"norm", 0.15, 0, Metric::None, 3},      {"more points", 0.15, 0, Metric::None, 1, 3}};

class DeviceCells : public ::testing::TestWithParam<Case> {
 protected:
  /// Most sets have a last batch with a few cells.
  void prepare(const Treatment& treatment, std::array<int, 3> counts) {
    const auto& [material, filling, order] = GetParam();
    HighOrderMesh mesh = testing::grid(filling, counts, order, testing::bent(testing::is_plane(filling) ? 2 : 3));
    testing::shake(mesh, treatment.shake / std::pow(std::max(order, 2), 3), 7);
    problem_ = testing::make_problem(mesh, treatment.more == 0 ? 0 : 2 * order + treatment.more);
    if (treatment.metric != Metric::None) set_metric(mesh, treatment.metric);
    for (CellSet& set : problem_.sets) {
      set.delta_squared.assign(static_cast<std::size_t>(set.count), treatment.delta);
      set.energy_slope.clear();
    }
    fast_ = make_kernels(material.material, problem_.dimension);
    plain_ = make_plain_kernels(material.material, problem_.dimension);
    hessian_ = make_hessian_kernels(material.material, problem_.dimension);
  }
  void set_metric(const HighOrderMesh& mesh, Metric metric) {
    Options options;
    options.target = Target::Size;
    const int components = problem_.dimension == 2 ? 3 : 6;
    options.target_field = {metric == Metric::Varies ? Per::Vertex : Per::Cell, components, {}, {}};
    const std::size_t count = metric == Metric::Varies ? mesh.node_count() : static_cast<std::size_t>(problem_.cells);
    const std::vector<double> entries{8, 3, 12, -1, 2, 9};
    for (std::size_t n = 0; n < count; ++n)
      for (int i = 0; i < components; ++i) {
        const double grows = metric == Metric::Varies ? 0.5 * mesh.coordinates[3 * n] : 0.01 * static_cast<double>(n);
        options.target_field.values.push_back((1 + grows) * entries[static_cast<std::size_t>(i)]);
      }
    const auto field = resolve_target_field(mesh, options);
    ASSERT_TRUE(field) << field.error().sentence;
    set_targets(problem_, *field, frame_of(mesh).diagonal);
    const bool has_axes = problem_.sets.front().left_factor.empty();
    EXPECT_FALSE(has_axes && (GetParam().filling == testing::Filling::Triangles ||
                              GetParam().filling == testing::Filling::Tetrahedra));
  }
  std::size_t unknowns() const { return problem_.free.size() * static_cast<std::size_t>(problem_.dimension); }

  void linearise(BatchSet& batch) const {
    const CellSet& set = *batch.cells;
    for (std::int32_t b = 0; b < batch.count; ++b) {
      AlignedVector<double> F(kBatch * set.deformation_size());
      for (std::int32_t cell = b * kBatch; cell < std::min(set.count, (b + 1) * kBatch); ++cell)
        fast_->deform(set, cell, problem_.positions,
                      F.data() + static_cast<std::size_t>(cell - b * kBatch) * set.deformation_size());
      hessian_->linearise(batch, b, F.data());
    }
  }
  static void compare(const BatchSet& batch, const device::SetOnDevice& set) {
    std::vector<float> linearisation(batch.linearisation.size()), mean(batch.mean.size());
    std::vector<std::int16_t> steps(batch.deformation.size());
    ASSERT_EQ(set.linearisation().bytes(), linearisation.size() * sizeof(float));
    ASSERT_TRUE(set.linearisation().download<float>(linearisation));
    ASSERT_TRUE(set.mean().download<float>(mean));
    ASSERT_TRUE(set.deformation().download<std::int16_t>(steps));
    // Partial derivatives of one kind stand at the same place of each point.
    const auto entries = static_cast<std::size_t>(batch.entries);
    std::vector<double> size(entries);
    for (std::size_t i = 0; i < linearisation.size(); ++i) {
      double& of_kind = size[i / kBatch % entries];
      of_kind = std::max(of_kind, std::abs(static_cast<double>(batch.linearisation[i])));
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

  Problem problem_;
  std::unique_ptr<Kernels> fast_, plain_;
  std::unique_ptr<HessianKernels> hessian_;
  std::unique_ptr<device::Device> cpu_ = device::make_cpu_device();
};

INSTANTIATE_TEST_SUITE_P(Materials, DeviceCells, ::testing::ValuesIn(every_case()),
                         [](const auto& info) { return name_of(info.param); });

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
      const auto cells = CellsOnDevice::make(*cpu_, problem_, GetParam().material.material);
      ASSERT_TRUE(cells) << cells.error().sentence;
      const auto scans = (*cells)->scan();
      ASSERT_TRUE(scans);
      ASSERT_EQ(scans->size(), static_cast<std::size_t>(problem_.cells));
      for (const CellSet& set : problem_.sets)
        for (std::int32_t cell = 0; cell < set.count; ++cell) {
          AlignedVector<double> F(set.deformation_size());
          plain_->deform(set, cell, problem_.positions, F.data());
          const CellScan plain = plain_->scan(set, cell, F.data(), nullptr);
          ASSERT_TRUE(treatment.delta > 0 || plain.smallest_jacobian > 0);
          const CellScan& ours = (*scans)[static_cast<std::size_t>(set.first + cell)];
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
      CellEnergy energy(problem_, *fast_, *hessian_, norm, team);
      std::vector<double> theirs(unknowns()), ours(unknowns()), again(unknowns());
      std::vector<float> direction, their_product(unknowns() + 4), our_product(unknowns());
      for (const double component : testing::random_direction(problem_, 3))
        direction.push_back(static_cast<float>(component));
      std::vector<float> padded_direction = direction;
      padded_direction.resize(unknowns() + 4);
      double their_along = 0;
      std::vector<double> weights, curvatures;
      team.run([&] {
        energy.scan();
        for (const CellSet& set : problem_.sets)
          for (std::int32_t cell = 0; cell < set.count; ++cell) {
            const double E = energy.scans()[static_cast<std::size_t>(set.first + cell)].energy;
            weights.push_back(norm.slope(E, cell_measure(set, cell)));
            if (!norm.is_sum()) curvatures.push_back(norm.curvature(E, cell_measure(set, cell)));
          }
        energy.linearise(theirs);
        their_along = energy.multiply(padded_direction, their_product);
      });
      for (CellSet& set : problem_.sets)
        set.energy_slope.assign(weights.begin() + set.first, weights.begin() + set.first + set.count);
      const auto cells = CellsOnDevice::make(*cpu_, problem_, GetParam().material.material);
      ASSERT_TRUE(cells) << cells.error().sentence;
      ASSERT_TRUE((*cells)->weigh(curvatures));
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
      double most = 0, terms = 0;
      for (std::size_t i = 0; i < unknowns(); ++i) {
        const double one = std::abs(static_cast<double>(their_product[i]));
        most = std::max(most, one);
        terms += one * std::abs(static_cast<double>(direction[i]));
      }
      for (std::size_t i = 0; i < unknowns(); ++i) EXPECT_NEAR(our_product[i], their_product[i], 1e-5 * most);
      EXPECT_NEAR(*along, their_along, 1e-5 * terms);
    }
}

// What the vectorised kernels have linearised a device can multiply, and the other way round.
TEST_P(DeviceCells, KeepsWhatTheVectorisedKernelsKeep) {
  prepare(kTreatments[0], {5, 1, 1});
  std::vector<BatchSet> batches = make_batches(problem_, *hessian_);
  const auto cells = CellsOnDevice::make(*cpu_, problem_, GetParam().material.material);
  ASSERT_TRUE(cells);
  std::vector<double> gradient(unknowns());
  ASSERT_TRUE((*cells)->linearise(gradient));
  for (std::size_t s = 0; s < batches.size(); ++s) {
    linearise(batches[s]);
    compare(batches[s], *(*cells)->sets()[s]);
  }
}

TEST(SplitCells, AreTakenWhereThereAreKernels) {
  using enum testing::Filling;
  const Material hyperelastic = every_material().front().material, winslow = every_material().back().material;
  const auto cpu = device::make_cpu_device();
  const auto has_own = [&](testing::Filling filling, int order, const Material& material, int degree) {
    const HighOrderMesh mesh =
        testing::grid(filling, {2, 1, 1}, order, testing::bent(testing::is_plane(filling) ? 2 : 3));
    Problem problem = testing::make_problem(mesh, degree);
    for (CellSet& set : problem.sets) set.delta_squared.assign(static_cast<std::size_t>(set.count), 0.25);
    const auto cells = CellsOnDevice::make(*cpu, problem, material);
    EXPECT_TRUE(cells);
    return dynamic_cast<const device::SplitCells*>((*cells)->sets().front().get()) != nullptr;
  };
  for (const auto filling : {Triangles, Tetrahedra, Quadrilaterals, Prisms, Hexahedra})
    for (const int order : {2, 3, 4}) {
      EXPECT_TRUE(has_own(filling, order, hyperelastic, 0));
      EXPECT_TRUE(has_own(filling, order, hyperelastic, 2 * order + 3)) << "more points";
      EXPECT_FALSE(has_own(filling, order, winslow, 0));
    }
  EXPECT_TRUE(has_own(Triangles, 5, hyperelastic, 0));
  EXPECT_TRUE(has_own(Tetrahedra, 5, hyperelastic, 0));
  EXPECT_FALSE(has_own(Hexahedra, 5, hyperelastic, 0));
  EXPECT_FALSE(has_own(Pyramids, 2, hyperelastic, 0));
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
