#include "client/io/outputs.h"

#include <gtest/gtest.h>

#include <fstream>

#include "client/process/temporary_folder.h"

namespace varimesh::client {
namespace {

class Outputs : public testing::Test {
 protected:
  std::string path(const std::string& name) const { return folder_.path() / name; }

 private:
  const TemporaryFolder folder_;
};

TEST_F(Outputs, HaveTheFormatOfTheInputUnlessTheEndingOrTheNameSaysOtherwise) {
  const auto plain = check_outputs({path("a.msh"), path("b.vtu")}, "");
  ASSERT_TRUE(plain);
  EXPECT_EQ((*plain)[0].format, v1::MESH_FORMAT_UNSPECIFIED);
  EXPECT_EQ((*plain)[1].format, v1::MESH_FORMAT_VTU);
  const auto binary = check_outputs({path("a.msh"), path("b.vtu")}, "msh41-binary");
  ASSERT_TRUE(binary);
  EXPECT_EQ((*binary)[0].format, v1::MESH_FORMAT_MSH41_BINARY);
  EXPECT_EQ((*binary)[1].format, v1::MESH_FORMAT_VTU);
}

TEST_F(Outputs, ThatEndInMshNeverHaveTheFormatOfMfem) {
  std::ofstream(path("in.mesh")) << "MFEM mesh v1.0\n";
  std::ofstream(path("in.msh")) << "$MeshFormat\n";
  const std::vector<std::string> paths{path("a.msh"), path("b.mesh")};
  const auto from_mfem = check_outputs(paths, "", path("in.mesh"));
  ASSERT_TRUE(from_mfem);
  EXPECT_EQ((*from_mfem)[0].format, v1::MESH_FORMAT_MSH41_BINARY);
  EXPECT_EQ((*from_mfem)[1].format, v1::MESH_FORMAT_MFEM);
  const auto from_msh = check_outputs(paths, "", path("in.msh"));
  ASSERT_TRUE(from_msh);
  EXPECT_EQ((*from_msh)[0].format, v1::MESH_FORMAT_UNSPECIFIED);
}

TEST_F(Outputs, UnknownEndingsFormatsAndFoldersAreRefused) {
  EXPECT_FALSE(check_outputs({path("a.xyz")}, ""));
  EXPECT_FALSE(check_outputs({path("a.msh")}, "xyz"));
  EXPECT_FALSE(check_outputs({path("missing/a.msh")}, ""));
}

TEST_F(Outputs, TheSameFileTwiceIsRefused) {
  const std::vector<Output> outputs{{path("a.msh")}, {path("b.msh")}};
  EXPECT_TRUE(check_distinct(outputs, {path("c.csv"), ""}, false));
  EXPECT_FALSE(check_distinct({{path("a.msh")}, {path("a.msh")}}, {}, false));
  EXPECT_FALSE(check_distinct(outputs, {path("./b.msh")}, false));
  EXPECT_FALSE(check_distinct(outputs, {path("missing/c.csv")}, false));
}

TEST_F(Outputs, EachFormatIsRequestedOnce) {
  const auto formats = formats_of({{"a.vtu", v1::MESH_FORMAT_VTU}, {"b.msh"}, {"c.vtu", v1::MESH_FORMAT_VTU}});
  EXPECT_EQ(formats, (std::vector<v1::MeshFormat>{v1::MESH_FORMAT_VTU, v1::MESH_FORMAT_UNSPECIFIED}));
}

}  // namespace
}  // namespace varimesh::client
