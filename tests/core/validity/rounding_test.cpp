// One step outwards turns a rounded result into a bound.
#include "core/validity/rounding.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace varimesh::detail {
namespace {

TEST(OutwardRounding, IsTheNextDouble) {
  constexpr double infinity = std::numeric_limits<double>::infinity(),
                   least = std::numeric_limits<double>::denorm_min(), most = std::numeric_limits<double>::max();
  for (const double x : {0.0, -0.0, least, -least, 2 * least, -2 * least, 1.0, -1.0, 1 - 0x1p-53, -2.0, 0x1p-1022,
                         -0x1p-1022, most, -most, infinity, -infinity, 3e-310, 6.02e23}) {
    EXPECT_EQ(next_above(x), std::nextafter(x, infinity)) << x;
    EXPECT_EQ(next_below(x), std::nextafter(x, -infinity)) << x;
  }
  EXPECT_TRUE(std::isnan(next_above(std::nan(""))) && std::isnan(next_below(std::nan(""))));
}

}  // namespace
}  // namespace varimesh::detail
