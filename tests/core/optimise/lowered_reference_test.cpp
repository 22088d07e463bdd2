// The reference implementation's regression value for the sphere. That implementation lowers the mesh to order 3 when
// it reads it.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "core/formats/formats.h"
#include "core/mesh/changes/change_order.h"
#include "core/optimise/optimiser.h"

namespace varimesh {
namespace {

TEST(LoweredReferenceMesh, FiveSweepsOfTheSphereEndWhereTheReferenceDoes) {
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
  // The reference samples at its nodes of order 3. It begins at 0.2355 there and ends at 0.6664 ± 0.02.
  EXPECT_NEAR(quality(*lowered, 3).min_scaled_jacobian, 0.2355, 0.01);
  EXPECT_NEAR(quality(result->mesh, 3).min_scaled_jacobian, 0.6664, 0.02);
}

}  // namespace
}  // namespace varimesh
