// Text and binary numbers to a sink, piece by piece.
#include "core/base/io/buffered_output.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <random>

namespace varimesh::formats {
namespace {

/// What `put` hands to a sink.
template <class Put>
std::string written(bool binary, const Put& put) {
  std::string bytes;
  const Sink sink = [&](std::string_view piece) {
    bytes += piece;
    return true;
  };
  BufferedOutput out(sink, binary);
  put(out);
  EXPECT_TRUE(out.finish());
  return bytes;
}

TEST(BufferedOutput, WritesTextWithSpaces) {
  EXPECT_EQ(written(false,
                    [](BufferedOutput& out) {
                      out.text("$Nodes\n");
                      out.integer(-3);
                      out.size(5'000'000'000);
                      out.number(0.1);
                      out.text_integer(7);
                      out.end_line();
                    }),
            "$Nodes\n-3 5000000000 0.1 7\n");
}

TEST(BufferedOutput, WritesNativeNumbersInBinary) {
  const std::string bytes = written(true, [](BufferedOutput& out) {
    out.integer(-3);
    out.size(5'000'000'000);
    out.number(0.1);
    out.end_line();
  });
  ASSERT_EQ(bytes.size(), 4U + 8U + 8U);
  std::int32_t number = 0;
  double real = 0;
  std::memcpy(&number, bytes.data(), 4);
  std::memcpy(&real, bytes.data() + 12, 8);
  EXPECT_EQ(number, -3);
  EXPECT_EQ(real, 0.1);
}

TEST(BufferedOutput, WritesNumbersThatReadAsTheSameDouble) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 2000; ++i) {
    const double value =
        std::ldexp(static_cast<double>(random() % (1ULL << 53)), static_cast<int>(random() % 400) - 250);
    const std::string text = written(false, [&](BufferedOutput& out) { out.text_number(value); });
    EXPECT_EQ(std::strtod(text.c_str(), nullptr), value) << text;
    EXPECT_LE(text.size(), 24U);
  }
}

TEST(BufferedOutput, KeepsTheOrderOfSmallAndLargePieces) {
  const std::string large(1 << 20, 'x');
  std::string expected;
  const std::string bytes = written(false, [&](BufferedOutput& out) {
    for (int i = 0; i < 5; ++i) {
      out.text_integer(i);
      out.text(large);
      expected += std::to_string(i) + large;
    }
  });
  EXPECT_EQ(bytes, expected);
}

TEST(BufferedOutput, HandsNothingMoreToASinkThatRefused) {
  int pieces = 0;
  const Sink sink = [&](std::string_view) { return ++pieces < 3; };
  BufferedOutput out(sink);
  const std::string large(1 << 20, 'x');
  for (int i = 0; i < 10; ++i) out.text(large);
  const auto finished = out.finish();
  ASSERT_FALSE(finished);
  EXPECT_EQ(finished.error().kind, Error::Kind::Output);
  EXPECT_EQ(pieces, 3);
}

}  // namespace
}  // namespace varimesh::formats
