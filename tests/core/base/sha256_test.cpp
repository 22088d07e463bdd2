// SHA-256, in one piece and in several.
#include "core/base/sha256.h"

#include <gtest/gtest.h>

namespace varimesh {
namespace {

TEST(Sha256, AgreesWithTheExamplesOfTheStandard) {
  // FIPS 180-4, the examples "abc" and the empty message.
  EXPECT_EQ(sha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

TEST(Sha256, DoesNotDependOnThePieces) {
  Sha256 hash;
  for (const char* piece : {"a", "", "bc"}) hash.update(piece);
  EXPECT_EQ(hash.finish(), sha256("abc"));
}

TEST(Sha256, KnowsTheFormOfADigest) {
  EXPECT_TRUE(is_sha256(sha256("abc")));
  EXPECT_FALSE(is_sha256(std::string(63, 'a')));
  EXPECT_FALSE(is_sha256(std::string(64, 'A')));
  EXPECT_FALSE(is_sha256(std::string(64, 'g')));
}

}  // namespace
}  // namespace varimesh
