// The energy of cells on a card, with a library in the place of the driver: the processor's bits, and what is left
// after each fault.
#include "core/device/card.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <limits>

#include "core/device/cpu_device.h"
#include "core/device_kernels/cell_modules.h"
#include "core/device_kernels/cells_on_device.h"
#include "core/device_kernels/self_check.h"
#include "tests/core/device/fake_card.h"
#include "tests/core/energy/materials.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh::device {
namespace {

class CellsOnACard : public ::testing::Test {
 protected:
  CellsOnACard() {
    mesh_ = testing::grid(testing::Filling::Tetrahedra, {2, 2, 1}, 3, testing::bent(3));
    problem_ = testing::make_problem(mesh_);
    for (CellSet& set : problem_.sets) set.delta_squared.assign(static_cast<std::size_t>(set.count), 0.25);
  }
  void SetUp() override {
    if (cell_kernels(Shape::Tetrahedron, 3, material_)->image.packed.empty())
      GTEST_SKIP() << "this build has no kernels for a card, because there was no clang";
  }
  void TearDown() override { unsetenv("FAKE_CUDA"); }

  std::unique_ptr<Device> card(const char* state) {
    auto card = testing::fake_card(state);
    EXPECT_TRUE(card);
    return std::move(*card);
  }
  Possible<std::vector<double>> gradient(Device& device) {
    const auto cells = CellsOnDevice::make(device, problem_, material_);
    if (!cells) return tl::unexpected(cells.error());
    std::vector<double> gradient(problem_.free.size() * static_cast<std::size_t>(problem_.dimension), 7);
    if (const auto done = (*cells)->linearise(gradient); !done) return tl::unexpected(done.error());
    return gradient;
  }

  Material material_ = material(Options{});
  HighOrderMesh mesh_;
  Problem problem_;
};

TEST_F(CellsOnACard, AreThoseOfTheProcessor) {
  const auto device = card(""), cpu = make_cpu_device();
  const auto ours = gradient(*device), theirs = gradient(*cpu);
  ASSERT_TRUE(ours) << ours.error().sentence;
  EXPECT_EQ(*ours, *theirs);
  EXPECT_TRUE(check_kernels(*device));
}

TEST_F(CellsOnACard, FailWithASentenceAndLeaveTheProblemWhole) {
  const std::vector<double> positions = problem_.positions;
  const struct {
    const char* state;
    Fault::Kind kind;
  } faults[] = {{"memory=20000", Fault::Kind::OutOfMemory},
                {"load=218", Fault::Kind::BadKernels},
                {"load=222", Fault::Kind::OldDriver},
                {"lost=1", Fault::Kind::Lost},
                {"lost=2", Fault::Kind::Lost},
                {"lost_at_wait=2", Fault::Kind::Lost}};
  for (const auto& [state, kind] : faults) {
    SCOPED_TRACE(state);
    const auto broken = gradient(*card(state));
    ASSERT_FALSE(broken);
    EXPECT_EQ(broken.error().kind, kind);
    EXPECT_EQ(broken.error().sentence.back(), '.');
    // The work goes on elsewhere from what the processor has.
    EXPECT_EQ(problem_.positions, positions);
    EXPECT_TRUE(gradient(*make_cpu_device()));
  }
}

TEST(SameNumbers, AreTheSameBitsOrAnyNan) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> one{1, nan, 0}, other_nan{1, -nan, 0}, other_zero{1, nan, -0.0}, shorter{1, nan};
  EXPECT_TRUE(same_numbers(one, one));
  EXPECT_TRUE(same_numbers(one, other_nan));
  EXPECT_FALSE(same_numbers(one, other_zero));
  EXPECT_FALSE(same_numbers(one, shorter));
}

TEST_F(CellsOnACard, AreThoseOfTheProcessorForEveryEnergy) {
  for (const int dimension : {2, 3}) {
    mesh_ = dimension == 2 ? testing::grid(testing::Filling::Quadrilaterals, {3, 2, 1}, 2, testing::bent(2))
                           : testing::grid(testing::Filling::Tetrahedra, {2, 1, 1}, 2, testing::bent(3));
    problem_ = testing::make_problem(mesh_);
    for (const NamedMaterial& one : every_material()) {
      SCOPED_TRACE(one.name);
      material_ = one.material;
      EXPECT_FALSE(general_kernels(dimension, material_).packed.empty());
      const auto device = card(""), cpu = make_cpu_device();
      const auto ours = gradient(*device), theirs = gradient(*cpu);
      ASSERT_TRUE(ours) << ours.error().sentence;
      EXPECT_EQ(*ours, *theirs);
    }
  }
}

}  // namespace
}  // namespace varimesh::device
