// Numbers and lines from a file's bytes, and where reading stopped.
#include "core/base/io/scanner.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace varimesh::formats {
namespace {

/// The sentence with which `read` fails.
template <class Read>
std::string failure(std::string_view bytes, const Read& read, bool binary = false) {
  Scanner scanner(bytes);
  scanner.binary = binary;
  scanner.section = "Nodes";
  try {
    read(scanner);
  } catch (const ReadFailure& failure) {
    return failure.sentence;
  }
  return "it was read";
}

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST(ScannerText, ReadsIntegersAndNumbers) {
  Scanner scanner("  7 -12\n+5 1.5e-3 .25 -0\n");
  EXPECT_EQ(scanner.text_integer("a"), 7);
  EXPECT_EQ(scanner.integer("b"), -12);
  EXPECT_EQ(scanner.size("c"), 5);
  EXPECT_EQ(scanner.number("d"), 1.5e-3);
  EXPECT_EQ(scanner.text_number("e"), 0.25);
  EXPECT_TRUE(std::signbit(scanner.number("f")));
  scanner.skip_space();
  EXPECT_TRUE(scanner.at_end());
}

TEST(ScannerText, ReadsNumbersBeyondTheRangeOfADouble) {
  Scanner scanner("1e999 -1e999 1e-999");
  EXPECT_EQ(scanner.text_number("a"), std::numeric_limits<double>::infinity());
  EXPECT_EQ(scanner.text_number("b"), -std::numeric_limits<double>::infinity());
  EXPECT_EQ(scanner.text_number("c"), 0);
}

TEST(ScannerText, NamesWhatItExpectedAndFound) {
  const auto integer = [](Scanner& s) { s.text_integer("the number of nodes"); };
  EXPECT_TRUE(has(failure("1\n\n",
                          [](Scanner& s) {
                            s.text_integer("a");
                            s.text_integer("b");
                          }),
                  "ends at byte 3 inside $Nodes"));
  EXPECT_TRUE(has(failure("\n\nfour", integer), "the number of nodes was expected, found 'four'"));
  EXPECT_TRUE(has(failure("\n\nfour", integer), "line 3, byte 2"));
  EXPECT_TRUE(has(failure("4x", integer), "found '4x'"));
  EXPECT_TRUE(has(failure("1234567890123456789012", integer), "found '1234567890123456789012'"));
  EXPECT_TRUE(has(failure(std::string("\x01\x02long-long-long-long-long-word", 31), integer), "..."))
      << "a long token is cut";
}

TEST(ScannerText, RefusesIntegersThatAreNone) {
  EXPECT_TRUE(has(failure("3000000000", [](Scanner& s) { s.integer("the tag"); }), "the tag is out of range"));
}

TEST(ScannerBinary, ReadsNativeNumbers) {
  std::string bytes;
  const auto put = [&](auto value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
  put(std::int32_t{-5});
  put(std::uint64_t{1} << 40);
  put(0.1);
  Scanner scanner(bytes);
  scanner.binary = true;
  EXPECT_EQ(scanner.integer("a"), -5);
  EXPECT_EQ(scanner.size("b"), std::int64_t{1} << 40);
  EXPECT_EQ(scanner.number("c"), 0.1);
  EXPECT_EQ(scanner.left(), 0U);
  EXPECT_TRUE(has(failure(
                      bytes.substr(0, 3), [](Scanner& s) { s.integer("a"); }, true),
                  "ends at byte 3"));
}

TEST(ScannerCount, NeverBelievesMoreThanTheFileCanHold) {
  const auto count = [](Scanner& s) { s.count("the number of nodes", 4); };
  EXPECT_EQ(failure("3 1 2 3 4 5 6", count), "it was read");
  EXPECT_TRUE(has(failure("99999 1 2 3", count), "99999, announces"));
  EXPECT_TRUE(has(failure("3000000000 1 2 3", count), "the number of nodes, 3000000000, exceeds 2147483647"));
  EXPECT_TRUE(has(failure("-1", count), "negative"));
}

TEST(ScannerLines, TakesALineWithoutItsEnd) {
  Scanner scanner("first \r\n\nthird");
  EXPECT_EQ(scanner.line(), "first");
  EXPECT_EQ(scanner.line(), "");
  EXPECT_EQ(scanner.line(), "third");
  EXPECT_TRUE(scanner.at_end());
}

TEST(ScannerLines, TakesTheBytesBeforeALine) {
  Scanner scanner("one $End\n$Ended\n$End \nrest");
  bool found = false;
  EXPECT_EQ(scanner.until_line("$End", found), "one $End\n$Ended\n");
  EXPECT_TRUE(found);
  EXPECT_EQ(scanner.line(), "$End") << "it stays before that line";
  scanner.until_line("$End", found);
  EXPECT_FALSE(found);
}

}  // namespace
}  // namespace varimesh::formats
