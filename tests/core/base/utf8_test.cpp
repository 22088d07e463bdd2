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

TEST(AsPlainText, EscapesWhatATerminalWouldObey) {
  EXPECT_EQ(as_plain_text("W\xc3\xa4nde \xf0\x9f\x98\x80 of 'a' \\ b"), "W\xc3\xa4nde \xf0\x9f\x98\x80 of 'a' \\ b");
  EXPECT_EQ(as_plain_text("a\nb\r\tc"), "a\\x0ab\\x0d\\x09c");
  EXPECT_EQ(as_plain_text("\x1b[31mred\x7f"), "\\x1b[31mred\\x7f");
  EXPECT_EQ(as_plain_text("\xc2\x9b"
                          "31m"),
            "\\u009b31m")
      << "a control sequence in one character";
  EXPECT_EQ(as_plain_text("a\xe2\x80\xae"
                          "b\xe2\x80\xa8"),
            "a\\u202eb\\u2028")
      << "backwards, and a line separator";
  EXPECT_EQ(as_plain_text("W\xe4nde"), "W\\xe4nde");
  EXPECT_EQ(as_plain_text(std::string(1, '\0')), "\\x00");
}

TEST(AsPlainText, KeepsTheBeginningAndTheEndOfALongText) {
  const std::string name(6'000'000, 'n');
  const std::string text = as_plain_text("The section '" + name + "' is unknown; remove it.");
  EXPECT_LE(text.size(), kMostTextBytes);
  EXPECT_GT(text.size(), kMostTextBytes - 8);
  EXPECT_EQ(text.rfind("The section 'nnn", 0), 0u);
  EXPECT_NE(text.find(" ... "), std::string::npos);
  EXPECT_NE(text.find("' is unknown; remove it."), std::string::npos);
  EXPECT_EQ(as_plain_text(text), text);
  for (const std::string unit : {"\x1b", "\xc3\xa4", "\xf0\x9f\x98\x80", "\xff"})
    for (const std::size_t length : {100, 255, 256, 257, 1000, 1023, 1024, 1025, 5000, 20000}) {
      std::string bytes = "x";
      while (bytes.size() < length) bytes += unit;
      const std::string plain = as_plain_text(bytes);
      EXPECT_LE(plain.size(), kMostTextBytes) << length;
      EXPECT_TRUE(is_utf8(plain)) << length << ": a character is cut";
      EXPECT_EQ(as_plain_text(plain), plain);
    }
  EXPECT_EQ(as_plain_text(std::string(1024, 'x')), std::string(1024, 'x'));
  EXPECT_EQ(as_plain_text(std::string(100, 'x'), 16).size(), 15u);
}

}  // namespace
}  // namespace varimesh
