// Arrays for vector loads begin on a cache line.
#include "core/base/aligned.h"

#include <gtest/gtest.h>

#include <cstdint>

namespace varimesh {
namespace {

TEST(AlignedVector, BeginsOnACacheLineWhateverItsSize) {
  for (std::size_t size = 1; size < 200; ++size) {
    AlignedVector<float> floats(size);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(floats.data()) % kCacheLine, 0U) << size;
    AlignedVector<double> doubles(size);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(doubles.data()) % kCacheLine, 0U) << size;
  }
}

TEST(AlignedVector, StaysAlignedWhileItGrows) {
  AlignedVector<char> bytes;
  for (int i = 0; i < 1000; ++i) {
    bytes.push_back('x');
    ASSERT_EQ(reinterpret_cast<std::uintptr_t>(bytes.data()) % kCacheLine, 0U);
  }
}

TEST(Padded, IsAPowerOfTwoNoSmallerThanTheDimension) {
  EXPECT_EQ(padded(2), 2);
  EXPECT_EQ(padded(3), 4);
}

TEST(UntouchedVector, KeepsWhatItIsGivenAndIsAligned) {
  UntouchedVector<float> numbers(7, 2.5F);
  numbers.push_back(3);
  numbers.resize(1000);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(numbers.data()) % kCacheLine, 0U);
  for (std::size_t i = 0; i < 7; ++i) EXPECT_EQ(numbers[i], 2.5F);
  EXPECT_EQ(numbers[7], 3);
}

}  // namespace
}  // namespace varimesh
