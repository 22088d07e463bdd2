// A mesh of all shapes is read, optimised and written. Gmsh opens the result and writes it again with the same
// coordinates.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "core/formats/formats.h"
#include "core/optimise/optimiser.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using formats::Format;

bool gmsh_is_there() { return std::system("/usr/bin/python3 -c 'import gmsh' >/dev/null 2>&1") == 0; }

/// Lets Gmsh read one file and write the other. True if Gmsh had no complaints.
bool written_again_by_gmsh(const std::string& from, const std::string& to) {
  const std::string program =
      "import gmsh; gmsh.initialize(); gmsh.option.setNumber(\"General.Terminal\", 0); "
      "gmsh.logger.start(); gmsh.open(\"" +
      from +
      "\"); "
      "bad = [line for line in gmsh.logger.get() if not line.startswith((\"Info\", \"Progress\"))]; "
      "gmsh.option.setNumber(\"Mesh.MshFileVersion\", 4.1); gmsh.option.setNumber(\"Mesh.Binary\", 1); "
      "gmsh.option.setNumber(\"Mesh.SaveAll\", 1); gmsh.write(\"" +
      to + "\"); gmsh.finalize(); exit(1 if bad else 0)";
  return std::system(("/usr/bin/python3 -c '" + program + "'").c_str()) == 0;
}

TEST(OptimisedFile, AMeshOfAllShapesComesBackFromGmsh) {
  if (!gmsh_is_there()) GTEST_SKIP() << "SKIPPED: Gmsh is not installed (python3-gmsh)";
  std::string folder = ::testing::TempDir() + "varimesh-round-trip-XXXXXX";
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  for (const testing::Filling filling : {testing::Filling::MixedPlane, testing::Filling::MixedSolid})
    for (const auto& [order, format] : {std::pair{2, Format::Msh22}, {3, Format::Msh41}, {4, Format::Msh41Binary}}) {
      HighOrderMesh mesh = testing::grid(filling, {3, 2, 2}, order, testing::bent(testing::is_plane(filling) ? 2 : 3));
      testing::shake(mesh, 0.01, 9);
      const std::string in = folder + "/in.msh", out = folder + "/out.msh", again = folder + "/again.msh";
      ASSERT_TRUE(formats::write_file(mesh, format, in));
      auto file = formats::read_file(in);
      ASSERT_TRUE(file) << file.error().sentence;
      mesh = file->mesh;  // some formats order nodes by entity
      ASSERT_TRUE(formats::write_file(mesh, format, out));
      const auto verbatim = formats::read_file(out);
      ASSERT_TRUE(verbatim) << verbatim.error().sentence;
      EXPECT_EQ(verbatim->mesh.coordinates, mesh.coordinates);
      EXPECT_EQ(verbatim->mesh.node_numbers, mesh.node_numbers);
      Options options;
      options.max_iterations = 3;
      const auto result = optimise(std::move(file->mesh), options);
      ASSERT_TRUE(result) << result.error().sentence;
      ASSERT_TRUE(formats::write_file(result->mesh, file->format, out));
      EXPECT_TRUE(written_again_by_gmsh(out, again));
      const auto back = formats::read_file(again);
      ASSERT_TRUE(back) << back.error().sentence;
      EXPECT_EQ(back->mesh.element_count(mesh.dimension), mesh.element_count(mesh.dimension));
      // Gmsh may order nodes by entity, so they are compared by number.
      std::vector<std::array<double, 3>> at(mesh.node_count() + 1);
      for (std::size_t n = 0; n < back->mesh.node_count(); ++n)
        std::copy_n(&back->mesh.coordinates[3 * n], 3, at[std::size_t(back->mesh.node_numbers[n])].begin());
      for (std::size_t n = 0; n < mesh.node_count(); ++n)
        for (std::size_t k = 0; k < 3; ++k)
          ASSERT_EQ(at[std::size_t(mesh.node_numbers[n])][k], result->mesh.coordinates[3 * n + k]);
    }
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace varimesh
