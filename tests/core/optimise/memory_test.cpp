// The estimate of memory against what the heap holds during a run.
#include "core/optimise/memory.h"

#include <gtest/gtest.h>
#include <malloc.h>

#include "core/optimise/optimiser.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

double bytes_in_use() {
  const auto info = ::mallinfo2();
  return static_cast<double>(info.uordblks) + static_cast<double>(info.hblkhd);
}

struct Sized {
  Filling filling;
  int count, order;
  Method method;
};

std::string name(const Sized& sized) {
  return std::string(testing::name(sized.filling)) + "OfOrder" + std::to_string(sized.order) +
         (sized.method == Method::Newton ? "ByNewton" : "BySweeps");
}

void PrintTo(const Sized& sized, std::ostream* out) { *out << name(sized); }

class MemoryEstimate : public ::testing::TestWithParam<Sized> {};

TEST_P(MemoryEstimate, IsAtMostTwiceWhatIsUsed) {
  if (bytes_in_use() == 0) GTEST_SKIP() << "NOT RUN: mallinfo2() counts nothing under this sanitizer";
  const Sized& sized = GetParam();
  const bool plane = testing::is_plane(sized.filling);
  const double before = bytes_in_use();
  HighOrderMesh mesh =
      testing::grid(sized.filling, {sized.count, sized.count, sized.count}, sized.order, testing::bent(plane ? 2 : 3));
  Options options;
  options.threads = 1;
  options.max_iterations = 3;
  options.method = sized.method;
  const auto needed = static_cast<double>(memory_needed(mesh, options));
  double most = 0;
  ASSERT_TRUE(optimise(std::move(mesh), options, [&](const Iteration&) {
    most = std::max(most, bytes_in_use() - before);
    return Control::Continue;
  }));
  EXPECT_GT(needed, most);
  EXPECT_LT(needed, 2 * most);
}

INSTANTIATE_TEST_SUITE_P(Meshes, MemoryEstimate,
                         ::testing::Values(Sized{Filling::Triangles, 30, 5, Method::Newton},
                                           Sized{Filling::Quadrilaterals, 30, 4, Method::Newton},
                                           Sized{Filling::Tetrahedra, 6, 3, Method::Newton},
                                           Sized{Filling::Tetrahedra, 8, 3, Method::Sweeps},
                                           Sized{Filling::Hexahedra, 7, 3, Method::Newton},
                                           Sized{Filling::MixedSolid, 6, 2, Method::Newton}),
                         [](const auto& info) { return name(info.param); });

}  // namespace
}  // namespace varimesh
