// CGNS files with very many groups, each of which HDF5 takes a while to make.
#include <gtest/gtest.h>

#include <chrono>
#include <map>
#include <string>

#include "core/formats/stoppable_write.h"
#include "tests/core/hdf/program.h"
#include "tests/core/support/groups.h"
#include "tests/core/support/processor_seconds.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;
using testing::square_in;

bool take(std::string_view) { return true; }

TEST(CgnsGroups, TakeTimeThatGrowsWithTheirNumberWhateverTheirNamesAre) {
  NEEDS_HDF5();
  const std::string same(40, 'g');
  const auto time = [](int groups, const auto& name) {
    const HighOrderMesh mesh = square_in(groups, name);
    const double begun = testing::processor_seconds_so_far();
    EXPECT_TRUE(formats::write(mesh, Format::Cgns, take));
    return testing::processor_seconds_so_far() - begun;
  };
  const auto alike = [&](int) { return same; };
  // Each name of 32 characters comes twice, and all of them begin alike.
  const auto twice = [&](int tag) { return same.substr(0, 26) + std::to_string(100000 + tag / 2); };
  const double few = time(500, alike);
  EXPECT_LT(time(8'000, alike), 24 * few) << "16 times the number; its square takes 256 times as long";
  EXPECT_LT(time(8'000, twice), 24 * few);
}

TEST(CgnsGroups, StopWhenTheyAreAskedTo) {
  NEEDS_HDF5();
  StopToken stop;
  const HighOrderMesh mesh = square_in(50'000);
  stop.stop_after(0.3);
  const auto begun = std::chrono::steady_clock::now();
  const auto written = formats::write(mesh, Format::Cgns, take, {}, 1, &stop);
  ASSERT_FALSE(written) << "it was fast";
  EXPECT_EQ(written.error().sentence, "Writing the mesh file was stopped before its end.");
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(3));
}

TEST(CgnsGroups, KeepNamesThatBeginAlike) {
  NEEDS_HDF5();
  const auto name = [](int tag) { return std::string(tag % 2 == 0 ? 31 : 33, 'g') + (tag == 7 ? "/" : ""); };
  const HighOrderMesh mesh = square_in(30, name);
  const auto file = formats::read(test::written(mesh, Format::Cgns));
  ASSERT_TRUE(file) << file.error().sentence;
  std::map<int, std::string> names;
  for (const PhysicalGroup& group : file->mesh.physical_groups) names[group.tag] = group.name;
  ASSERT_EQ(names.size(), 30U);
  for (const auto& [tag, came] : names) EXPECT_EQ(came, name(tag)) << tag;
}

}  // namespace
}  // namespace varimesh
