// Meshes with very many groups: what strangers send must not take time that grows with the square of its size, because
// nobody looks at a cancel while a mesh is written.
#include <gtest/gtest.h>

#include <numeric>

#include "core/formats/formats.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/processor_seconds.h"

namespace varimesh::formats {
namespace {

/// A square that is in this many groups, each with a name.
HighOrderMesh square_in(int groups) {
  HighOrderMesh mesh = testing::grid(testing::Filling::Quadrilaterals, {1, 1, 0}, 1);
  mesh.blocks[0].physical.resize(std::size_t(groups));
  std::iota(mesh.blocks[0].physical.begin(), mesh.blocks[0].physical.end(), 1);
  for (const int tag : mesh.blocks[0].physical) mesh.physical_groups.push_back({2, tag, "g" + std::to_string(tag)});
  return mesh;
}

/// A row of squares for Abaqus, each of them in a set of its own.
std::string squares_in_sets(int count) {
  std::string nodes = "*NODE\n", elements = "*ELEMENT, TYPE=CPS4\n", sets;
  const auto node = [](int number, int x, int y) {
    return std::to_string(number) + "," + std::to_string(x) + "," + std::to_string(y) + ",0\n";
  };
  for (int i = 0; i <= count; ++i) nodes += node(2 * i + 1, i, 0) + node(2 * i + 2, i, 1);
  for (int i = 1; i <= count; ++i) {
    const auto corner = [&](int k) { return "," + std::to_string(2 * i + k); };
    elements += std::to_string(i) + corner(-1) + corner(1) + corner(2) + corner(0) + "\n";
    sets += "*ELSET, ELSET=S" + std::to_string(i) + "\n" + std::to_string(i) + "\n";
  }
  return "*HEADING\n" + nodes + elements + sets;
}

class Writing : public ::testing::TestWithParam<Format> {};

TEST_P(Writing, TakesTimeThatGrowsWithTheNumberOfGroups) {
  const auto time = [&](int groups) {
    const HighOrderMesh mesh = square_in(groups);
    return testing::processor_seconds(
        [&] { ASSERT_TRUE(write(mesh, GetParam(), [](std::string_view) { return true; })); });
  };
  const double few = time(10'000);
  EXPECT_LT(time(80'000), 24 * few) << "8 times the number; its square takes 64 times as long";
}

INSTANTIATE_TEST_SUITE_P(Formats, Writing,
                         ::testing::Values(Format::Msh22, Format::Msh41, Format::Vtu, Format::Mfem, Format::Nektar));

TEST(Reading, TakesTimeThatGrowsWithTheNumberOfSets) {
  const auto time = [](int count) {
    const std::string bytes = squares_in_sets(count);
    return testing::processor_seconds([&] {
      const auto file = read(bytes);
      ASSERT_TRUE(file) << file.error().sentence;
      ASSERT_EQ(file->mesh.physical_groups.size(), std::size_t(count));
    });
  };
  const double few = time(2'000);
  EXPECT_LT(time(16'000), 24 * few);
}

}  // namespace
}  // namespace varimesh::formats
