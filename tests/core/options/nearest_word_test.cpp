// Which word a misspelt one stands for.
#include "core/options/nearest_word.h"

#include <gtest/gtest.h>

namespace varimesh {
namespace {

const std::vector<std::string> kOptions = {"--energy", "--method", "--max-iterations", "--tolerance", "--mu", "-o"};

TEST(NearestWord, FindsAWordWithOneMistake) {
  EXPECT_EQ(nearest_word("--enrgy", kOptions), "--energy") << "a letter is missing";
  EXPECT_EQ(nearest_word("--ennergy", kOptions), "--energy") << "a letter is too many";
  EXPECT_EQ(nearest_word("--enetgy", kOptions), "--energy") << "a letter is wrong";
  EXPECT_EQ(nearest_word("--enregy", kOptions), "--energy") << "two letters are swapped";
}

TEST(NearestWord, CountsASwapAsOneMistake) {
  // A word of three letters may have one mistake. Two wrong letters would be too many.
  EXPECT_EQ(nearest_word("bca", {"bac"}), "bac");
  EXPECT_EQ(nearest_word("bxy", {"bac"}), "");
}

TEST(NearestWord, AllowsAMistakeForEveryThreeLetters) {
  EXPECT_EQ(nearest_word("tolreanze", {"tolerance"}), "tolerance");
  EXPECT_EQ(nearest_word("tolxxxxce", {"tolerance"}), "");
}

TEST(NearestWord, PrefersTheWordWithFewerMistakes) {
  EXPECT_EQ(nearest_word("winslov", {"window", "winslow"}), "winslow");
  EXPECT_EQ(nearest_word("winslov", {"winslow", "window"}), "winslow");
}

TEST(NearestWord, TakesTheBeginningOfALongerWord) {
  EXPECT_EQ(nearest_word("--max", kOptions), "--max-iterations");
  EXPECT_EQ(nearest_word("--to", kOptions), "--tolerance");
}

TEST(NearestWord, FindsNothingWhereNoWordIsNear) {
  EXPECT_EQ(nearest_word("--colour", kOptions), "");
  EXPECT_EQ(nearest_word("anything", {}), "");
}

}  // namespace
}  // namespace varimesh
