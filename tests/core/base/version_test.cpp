// The version has three numbers, and the machine has vector instructions with a name.
#include "core/base/version.h"

#include <gtest/gtest.h>

#include <regex>
#include <string>

namespace varimesh {
namespace {

TEST(Version, HasThreeNumbers) {
  EXPECT_TRUE(std::regex_match(std::string(version()), std::regex("[0-9]+\\.[0-9]+\\.[0-9]+"))) << version();
}

TEST(Version, NamesTheVectorInstructions) {
  EXPECT_FALSE(vector_instructions().empty());
  EXPECT_NE(vector_instructions(), "Unknown");
}

}  // namespace
}  // namespace varimesh
