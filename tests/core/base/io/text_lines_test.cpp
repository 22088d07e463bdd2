// Lists written by hand: lines, words, comments and numbers.
#include "core/base/io/text_lines.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

namespace varimesh {
namespace {

TEST(NextWord, TakesWordsBetweenBlanks) {
  std::string_view line = "  one\ttwo  three\r";
  EXPECT_EQ(next_word(line), "one");
  EXPECT_EQ(next_word(line), "two");
  EXPECT_EQ(next_word(line), "three");
  EXPECT_EQ(next_word(line), "");
  EXPECT_EQ(next_word(line), "");
}

TEST(NextLine, PassesOverEmptyLinesAndComments) {
  std::string_view text = "# heading\n\n  first 1\n \t\nsecond # why\n#\nlast", line;
  std::size_t number = 0;
  std::vector<std::pair<std::size_t, std::string>> lines;
  while (next_line(text, line, number)) lines.emplace_back(number, line);
  EXPECT_EQ(lines, (std::vector<std::pair<std::size_t, std::string>>{{3, "  first 1"}, {5, "second "}, {7, "last"}}));
}

TEST(NextLine, FindsNoneInAnEmptyText) {
  std::string_view text = "\n# only a comment\n", line;
  std::size_t number = 0;
  EXPECT_FALSE(next_line(text, line, number));
}

TEST(Parse, TakesAWholeNumberOrNone) {
  std::int64_t whole = 0;
  EXPECT_TRUE(parse("-42", whole));
  EXPECT_EQ(whole, -42);
  EXPECT_TRUE(parse("+7", whole));
  EXPECT_EQ(whole, 7);
  for (const char* word : {"", "+", "4x", "4.5", "x4", "99999999999999999999"})
    EXPECT_FALSE(parse(word, whole)) << word;
}

TEST(Parse, TakesARealNumberOrNone) {
  double real = 0;
  EXPECT_TRUE(parse("-1.5e-3", real));
  EXPECT_EQ(real, -1.5e-3);
  EXPECT_TRUE(parse("+2", real));
  EXPECT_EQ(real, 2);
  for (const char* word : {"", "nope", "1,5", "1.5.2"}) EXPECT_FALSE(parse(word, real)) << word;
}

}  // namespace
}  // namespace varimesh
