// The estimate of the memory that the search for cusps takes, against the most that the heap holds.
#include "core/repair/boundary/cusps.h"

#include <gtest/gtest.h>

#include "core/association/association.h"
#include "core/mesh/connectivity.h"
#include "tests/core/memory/counted_heap.h"
#include "tests/core/support/disc_mesh.h"

namespace varimesh {
namespace {

class CuspsMemory : public ::testing::TestWithParam<int> {};

INSTANTIATE_TEST_SUITE_P(Orders, CuspsMemory, ::testing::Values(2, 3, 5));

TEST_P(CuspsMemory, IsNotMoreThanTheEstimate) {
  if (testing::bytes_in_use() == 0) GTEST_SKIP() << "NOT RUN: a sanitizer has an allocator of its own";
  const geometry::Geometry cylinder = testing::solid_cylinder();
  const HighOrderMesh mesh = testing::DiscMesh(9, GetParam()).mesh();
  std::vector<std::int64_t> all;
  const Cells cells(mesh, 3);
  for (std::size_t c = 0; c < cells.count(); ++c) all.push_back(cells.number(c));
  std::ranges::sort(all);
  const auto estimate = static_cast<double>(bytes_of_cusps(count(mesh, mesh.order)));
  const Team team(1);
  const std::int64_t before = testing::bytes_in_use();
  testing::forget_peak();
  team.run([&] {
    auto association = associate(mesh, cylinder, team);
    ASSERT_TRUE(association) << association.error().sentence;
    EXPECT_TRUE(cusps(mesh, *association, all).empty());
  });
  const auto peak = static_cast<double>(testing::peak_bytes() - before);
  EXPECT_GE(estimate, peak);
  EXPECT_LE(estimate, 1.5 * peak);
}

}  // namespace
}  // namespace varimesh
