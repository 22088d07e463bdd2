#include "client/library/zstd_frame.h"

#include <gtest/gtest.h>

#include <random>

namespace varimesh::client {
namespace {

TEST(ZstdFrame, ExpandsToTheSameBytes) {
  const std::string bytes(100'000, 'x');
  const std::string frame = compress_frame(bytes);
  ASSERT_FALSE(frame.empty());
  EXPECT_LT(frame.size(), bytes.size() / 8);
  std::string expanded;
  ASSERT_TRUE(expand_frame(frame, bytes.size(), &expanded));
  EXPECT_EQ(expanded, bytes);
}

TEST(ZstdFrame, BytesThatDoNotCompressGiveNoFrame) {
  std::mt19937 random(1);
  std::string bytes(10'000, '\0');
  for (char& byte : bytes) byte = static_cast<char>(random());
  EXPECT_EQ(compress_frame(bytes), "");
  EXPECT_EQ(compress_frame(""), "");
}

TEST(ZstdFrame, AFrameThatHoldsMoreThanIsAllowedIsRefused) {
  const std::string frame = compress_frame(std::string(100'000, 'x'));
  std::string expanded;
  EXPECT_FALSE(expand_frame(frame, 99'999, &expanded));
}

TEST(ZstdFrame, ADamagedFrameIsRefused) {
  const std::string frame = compress_frame(std::string(100'000, 'x'));
  std::string expanded;
  EXPECT_FALSE(expand_frame(frame.substr(0, frame.size() - 1), 200'000, &expanded));
  EXPECT_FALSE(expand_frame("not a frame", 200'000, &expanded));
  EXPECT_FALSE(expand_frame("", 200'000, &expanded));
}

}  // namespace
}  // namespace varimesh::client
