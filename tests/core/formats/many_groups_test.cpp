// Meshes with very many groups: what strangers send must not take time that grows with the square of its size, and a
// token stops what takes long.
#include <gtest/gtest.h>

#include <string>

#include "core/formats/stoppable_write.h"
#include "tests/core/support/groups.h"
#include "tests/core/support/processor_seconds.h"

namespace varimesh::formats {
namespace {

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
    const HighOrderMesh mesh = testing::square_in(groups);
    return testing::processor_seconds(
        [&] { ASSERT_TRUE(write(mesh, GetParam(), [](std::string_view) { return true; })); });
  };
  const double few = time(10'000);
  EXPECT_LT(time(80'000), 24 * few) << "8 times the number; its square takes 64 times as long";
}

TEST_P(Writing, StopsWhenItIsAskedTo) {
  const StopToken stop([] { return true; });
  bool came = false;
  const auto written = write(
      testing::square_in(10), GetParam(), [&](std::string_view) { return came = true; }, {}, 2, &stop);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().sentence, "Writing the mesh file was stopped before its end.");
  EXPECT_FALSE(came);
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
