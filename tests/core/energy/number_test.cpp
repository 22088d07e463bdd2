// The vectorised logarithm and inverse cube root against quadruple precision, on every instruction set of this machine.
#include <quadmath.h>

#include <cmath>
#include <random>
#include <vector>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/core/energy/number_test.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

#include "core/energy/number-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// In place. `count` is a multiple of every vector's width.
void take_logarithms(double* x, std::size_t count) {
  const hn::ScalableTag<double> d;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) hn::StoreU(logarithm(hn::LoadU(d, x + i)), d, x + i);
}

void take_inverse_cube_roots(double* x, std::size_t count) {
  const hn::ScalableTag<double> d;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) hn::StoreU(inverse_cube_root(hn::LoadU(d, x + i)), d, x + i);
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <gtest/gtest.h>
#include <hwy/targets.h>

namespace varimesh {
namespace {

HWY_EXPORT(take_logarithms);
HWY_EXPORT(take_inverse_cube_roots);

constexpr std::size_t kCount = 1 << 16;

/// Calls use(name) once for each of the machine's instruction sets, with that one selected. Afterwards all are
/// available again.
template <class Use>
void on_every_target(const Use& use) {
  const std::int64_t supported = hwy::SupportedTargets();
  for (std::int64_t left = supported; left != 0; left &= left - 1) {
    hwy::SetSupportedTargetsForTest(left & -left);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    use(hwy::TargetName(left & -left));
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

/// Numbers with every exponent, numbers near 1, and the ends of the intervals of the series.
std::vector<double> positive_numbers() {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> fraction(1, 2), near(-1e-3, 1e-3);
  std::vector<double> x{1, 0.5, 2, 0x1p-1022, 0x1.fffffffffffffp1023};
  for (const double edge : {std::sqrt(0.5), 1.0, std::sqrt(2.0)})
    for (const double beside : {std::nextafter(edge, 0), edge, std::nextafter(edge, 2)}) x.push_back(beside);
  for (int exponent = -1022; exponent < 1024; ++exponent) x.push_back(std::ldexp(fraction(random), exponent));
  for (int i = 0; i < 5000; ++i) x.push_back(1 + near(random));
  while (x.size() < kCount) x.push_back(fraction(random) * fraction(random) / 2);
  return x;
}

/// The error in units in the last place.
double error_of(double got, __float128 exact) {
  const double rounded = std::abs(static_cast<double>(exact));
  if (rounded == 0) return got == 0 ? 0 : 1e9;
  return std::abs(static_cast<double>(got - exact)) / (std::nextafter(rounded, 1e308) - rounded);
}

TEST(VectorFunctions, LogarithmsAreRightToTwoUnitsInTheLastPlace) {
  const std::vector<double> x = positive_numbers();
  on_every_target([&](const char* target) {
    std::vector<double> got = x;
    HWY_DYNAMIC_DISPATCH(take_logarithms)(got.data(), kCount);
    for (std::size_t i = 0; i < kCount; ++i) ASSERT_LE(error_of(got[i], logq(x[i])), 2) << target << ", of " << x[i];
  });
}

TEST(VectorFunctions, LogarithmsOfNumbersWithoutOneAreFinite) {
  std::vector<double> x(kCount, -1.0);
  x[0] = 0;
  x[1] = HUGE_VAL;
  x[2] = std::nan("");
  x[3] = -0.0;
  x[4] = 0x1p-1060;
  on_every_target([&](const char* target) {
    std::vector<double> got = x;
    HWY_DYNAMIC_DISPATCH(take_logarithms)(got.data(), kCount);
    for (std::size_t i = 0; i < 8; ++i) EXPECT_TRUE(std::isfinite(got[i])) << target << ", of " << x[i];
  });
}

TEST(VectorFunctions, InverseCubeRootsAreRightToTwoUnitsInTheLastPlace) {
  const std::vector<double> x = positive_numbers();
  on_every_target([&](const char* target) {
    std::vector<double> got = x;
    HWY_DYNAMIC_DISPATCH(take_inverse_cube_roots)(got.data(), kCount);
    for (std::size_t i = 0; i < kCount; ++i)
      ASSERT_LE(error_of(got[i], 1 / cbrtq(x[i])), 2) << target << ", of " << x[i];
  });
}

}  // namespace
}  // namespace varimesh
#endif  // HWY_ONCE
