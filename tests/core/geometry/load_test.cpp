#include "core/geometry/load.h"

#include <gtest/gtest.h>

#include <cstdlib>

namespace varimesh::geometry {
namespace {

TEST(Load, NamesAFileThatDoesNotExist) {
  const auto geometry = load("no-such-file.step");
  ASSERT_FALSE(geometry);
  EXPECT_EQ(geometry.error().kind, Error::Kind::BadInput);
  EXPECT_NE(geometry.error().sentence.find("'no-such-file.step' is not a file"), std::string::npos);
}

TEST(Load, SaysWhatToInstallIfThereIsNoPlugin) {
  setenv("VARIMESH_OPENCASCADE", "no-such-plugin.so", 1);
  const auto geometry = load(VARIMESH_SOURCE_DIR "/README.md");
  unsetenv("VARIMESH_OPENCASCADE");
  ASSERT_FALSE(geometry);
  EXPECT_EQ(geometry.error().kind, Error::Kind::BadOption);
  EXPECT_NE(geometry.error().sentence.find("without OpenCASCADE"), std::string::npos);
}

}  // namespace
}  // namespace varimesh::geometry
