// The reference implementation's regression value on the sphere, whose mesh it lowers to order 3 on the way in.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "core/formats/formats.h"
#include "core/mesh/change_order.h"
#include "core/optimise/optimiser.h"

namespace varimesh {
namespace {

TEST(LoweredReference, FiveSweepsOfTheSphereEndWhereTheReferenceDoes) {
  const char* folder = std::getenv("VARIMESH_CASES");
  const std::filesystem::path path = std::filesystem::path(folder ? folder : VARIMESH_SOURCE_DIR "/../shared/cases") /
                                     "meshes/reference_sphere276_p4.msh";
  if (!std::filesystem::exists(path))
    GTEST_SKIP() << "NOT RUN: the shared cases are not at " << path << "; set VARIMESH_CASES to their folder.";
  const auto file = formats::read_file(path.string());
  ASSERT_TRUE(file) << file.error().sentence;
  const auto lowered = change_order(file->mesh, 3);
  ASSERT_TRUE(lowered) << lowered.error().sentence;
  Options options;
  options.constants = Constants::Reference;
  options.method = Method::Sweeps;
  options.colouring = Colouring::Node;
  options.max_iterations = 5;
  const auto result = optimise(*lowered, options);
  ASSERT_TRUE(result) << result.error().sentence;
  EXPECT_EQ(result->sizes.free_nodes, 868);
  // At the nodes of order 3, as the reference samples it: .6664 ± .02, from .2355 on its own nodes of that order.
  EXPECT_NEAR(quality(*lowered, 3).min_scaled_jacobian, 0.2355, 0.01);
  EXPECT_NEAR(quality(result->mesh, 3).min_scaled_jacobian, 0.6664, 0.02);
}

}  // namespace
}  // namespace varimesh
