// UTF-8 is told from other bytes by table 3-7 of the Unicode standard.
#include "core/base/utf8.h"

#include <gtest/gtest.h>

#include <vector>

namespace varimesh {
namespace {

TEST(IsUtf8, AcceptsSequencesOfEveryLength) {
  const std::vector<std::string> texts = {
      "",
      "plain",
      "\xc2\x80",          // U+0080, the lowest of two bytes
      "\xc3\xa4",          // ä
      "\xe0\xa0\x80",      // U+0800, the lowest of three bytes
      "\xe2\x82\xac",      // €
      "\xed\x9f\xbf",      // U+D7FF, the last before the surrogates
      "\xf0\x90\x80\x80",  // U+10000, the lowest of four bytes
      "\xf0\x9f\x98\x80",  // an emoji
      "\xf4\x8f\xbf\xbf",  // U+10FFFF, the highest
  };
  for (const std::string& text : texts) EXPECT_TRUE(is_utf8(text)) << text;
}

TEST(IsUtf8, RefusesBytesThatAreNoCharacter) {
  const std::vector<std::string> others = {
      "W\xe4nde",          // Latin-1
      "\x80",              // a second byte without a first
      "\xc3",              // cut off
      "\xe2\x82",          // cut off
      "\xc0\x80",          // overlong
      "\xe0\x80\x80",      // overlong
      "\xf0\x80\x80\x80",  // overlong
      "\xed\xa0\x80",      // a surrogate
      "\xf4\x90\x80\x80",  // above U+10FFFF
      "\xff",
  };
  for (const std::string& other : others) EXPECT_FALSE(is_utf8(other)) << as_utf8(other);
}

TEST(AsUtf8, WritesOtherBytesInHexadecimal) {
  EXPECT_EQ(as_utf8("W\xe4nde \xc3\xa4"), "W\\xe4nde \xc3\xa4");
  EXPECT_EQ(as_utf8("\xe2\x82"), "\\xe2\\x82");
  EXPECT_EQ(as_utf8("plain"), "plain");
}

TEST(AsUtf8, AlwaysGivesUtf8) {
  std::string every;
  for (int byte = 0; byte < 256; ++byte) every += static_cast<char>(byte);
  EXPECT_FALSE(is_utf8(every));
  EXPECT_TRUE(is_utf8(as_utf8(every)));
}

}  // namespace
}  // namespace varimesh
