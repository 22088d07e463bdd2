// The patch test: a straight-sided mesh with shaken inner nodes becomes straight-sided again, for every shape, mixture,
// order and energy.
#include <gtest/gtest.h>

#include <cstdlib>

#include "core/optimise/optimiser.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

struct PatchCase {
  Filling filling;
  int order;
};

std::string name(const PatchCase& one) {
  return std::string(testing::name(one.filling)) + "Order" + std::to_string(one.order);
}

void PrintTo(const PatchCase& one, std::ostream* out) { *out << name(one); }

std::vector<PatchCase> every_case() {
  std::vector<PatchCase> cases;
  for (const Filling filling : testing::kFillings)
    for (int order = 2; order <= 8; ++order) cases.push_back({filling, order});
  return cases;
}

/// Above this order in 3-D the patch tests take minutes. They run only if VARIMESH_LONG_TESTS is set.
constexpr int kLongAbove = 4;

class PatchTest : public ::testing::TestWithParam<PatchCase> {};

TEST_P(PatchTest, ReturnsToTheStraightSidedMesh) {
  const auto [filling, order] = GetParam();
  const bool plane = testing::is_plane(filling);
  if (!plane && order > kLongAbove && std::getenv("VARIMESH_LONG_TESTS") == nullptr)
    GTEST_SKIP() << "NOT RUN: long; set VARIMESH_LONG_TESTS=1";
  const std::array<int, 3> counts = plane                            ? std::array{3, 2, 0}
                                    : filling == Filling::MixedSolid ? std::array{3, 1, 2}
                                    : order <= kLongAbove            ? std::array{2, 2, 1}
                                                                     : std::array{2, 1, 1};
  const HighOrderMesh straight = testing::grid(filling, counts, order, testing::bent(plane ? 2 : 3, 0.05));
  HighOrderMesh shaken = straight;
  testing::shake(shaken, 0.04 / (order * order), 5);
  ASSERT_GT(testing::distance(straight, shaken), 1e-4);
  for (const Energy energy : {Energy::Hyperelastic, Energy::LinearElastic, Energy::Winslow, Energy::Distortion}) {
    Options options;
    options.energy = energy;
    options.tolerance = 1e-9;
    const auto result = optimise(shaken, options);
    ASSERT_TRUE(result) << result.error().sentence;
    EXPECT_TRUE(result->converged);
    EXPECT_LE(testing::distance(straight, result->mesh), 1e-8) << "energy " << static_cast<int>(energy);
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, PatchTest, ::testing::ValuesIn(every_case()),
                         [](const auto& info) { return name(info.param); });

TEST(PatchTest, NothingMovesInALinearMeshAtItsOptimum) {
  for (const Filling filling : testing::kFillings) {
    const HighOrderMesh mesh = testing::grid(filling, {3, 3, 3}, 1, testing::bent(testing::is_plane(filling) ? 2 : 3));
    const auto result = optimise(mesh);
    ASSERT_TRUE(result) << result.error().sentence;
    EXPECT_TRUE(result->converged);
    EXPECT_LE(testing::distance(mesh, result->mesh), 1e-12) << testing::name(filling);
  }
}

}  // namespace
}  // namespace varimesh
