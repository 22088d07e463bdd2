// Mesh files on disk: what is written replaces the old file as a whole, and errors name the path.
#include <gtest/gtest.h>

#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;
using test::Folder;

std::size_t files_in(const std::string& folder) {
  return std::size_t(std::distance(std::filesystem::directory_iterator(folder), {}));
}

TEST(WriteFile, ReplacesWhatWasThereAndLeavesNothingBeside) {
  const Folder folder;
  const HighOrderMesh mesh = test::one_cell(Shape::Triangle, 2);
  ASSERT_TRUE(formats::write_file(mesh, Format::Msh41, folder.file("a.msh")));
  ASSERT_TRUE(formats::write_file(mesh, Format::Msh22, folder.file("a.msh")));
  EXPECT_EQ(test::slurp(folder.file("a.msh")), test::written(mesh, Format::Msh22));
  EXPECT_EQ(files_in(folder.path()), 1u);
}

TEST(WriteFile, FailureLeavesTheOldFileAndNoOther) {
  const Folder folder;
  ASSERT_TRUE(formats::write_file(test::one_cell(Shape::Hexahedron, 1), Format::Msh22, folder.file("a.msh")));
  const std::string before = test::slurp(folder.file("a.msh"));
  ASSERT_FALSE(formats::write_file(test::one_cell(Shape::Hexahedron, 10), Format::Msh22, folder.file("a.msh")));
  EXPECT_EQ(test::slurp(folder.file("a.msh")), before);
  EXPECT_EQ(files_in(folder.path()), 1u);
}

TEST(WriteFile, AFullDiskIsAnOutputError) {
  std::size_t taken = 0;
  const auto done = formats::write(test::one_cell(Shape::Hexahedron, 9), Format::Msh41, [&](std::string_view piece) {
    taken += piece.size();
    return false;
  });
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().kind, Error::Kind::Output);
  EXPECT_GT(taken, 0u);
}

TEST(CheckWritable, SaysBeforehand) {
  const Folder folder;
  EXPECT_TRUE(formats::check_writable(folder.file("new.msh")));
  EXPECT_EQ(files_in(folder.path()), 0u);
  for (const std::string& path : {folder.path(), folder.file("no/such/folder.msh"), std::string()}) {
    const auto done = formats::check_writable(path);
    ASSERT_FALSE(done) << path;
    EXPECT_EQ(done.error().kind, Error::Kind::Output);
  }
}

TEST(ReadFile, ErrorsNameThePath) {
  const Folder folder;
  const auto missing = formats::read_file(folder.file("missing.msh"));
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().sentence.find("missing.msh"), std::string::npos);
  EXPECT_FALSE(formats::read_file(folder.path()));
  std::ofstream(folder.file("empty.msh")).flush();
  const auto empty = formats::read_file(folder.file("empty.msh"));
  ASSERT_FALSE(empty);
  EXPECT_NE(empty.error().sentence.find("empty"), std::string::npos);
}

}  // namespace
}  // namespace varimesh
