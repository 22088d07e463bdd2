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

}  // namespace
}  // namespace varimesh
