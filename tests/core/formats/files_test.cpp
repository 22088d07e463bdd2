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

TEST(ReadFile, RefusesAMeshThatIsLargerThanMemoryBeforeItIsRead) {
  const Folder folder;
  const HighOrderMesh mesh = test::one_cell(Shape::Triangle, 2);
  ASSERT_TRUE(formats::write_file(mesh, Format::Msh41, folder.file("a.msh")));
  // A hole at the end of the file: it has 8 TiB, and takes no room on the disk.
  std::filesystem::resize_file(folder.file("a.msh"), std::uintmax_t{1} << 43);
  const auto refused = formats::read_file(folder.file("a.msh"), std::int64_t{1} << 40);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().kind, Error::Kind::BadInput);
  EXPECT_NE(refused.error().sentence.find("a.msh': The file has 8388608 MiB. Its mesh takes at least 1677722 MiB of "
                                          "memory, but only 1048576 MiB may be used"),
            std::string::npos)
      << refused.error().sentence;
}

TEST(CheckMemory, AcceptsWhatMayFit) {
  EXPECT_TRUE(formats::check_memory(5000, 1000));
  EXPECT_FALSE(formats::check_memory(5005, 1000));
  EXPECT_TRUE(formats::check_memory(std::int64_t{1} << 60, 0)) << "no limit";
}

TEST(LeastMemory, IsAtMostThatOfTheMesh) {
  for (const Format format : {Format::Msh22, Format::Msh22Binary, Format::Msh41, Format::Msh41Binary})
    for (const Shape shape : {Shape::Triangle, Shape::Tetrahedron, Shape::Hexahedron})
      for (const int order : {1, 4}) {
        const HighOrderMesh mesh = test::one_cell(shape, order);
        std::size_t bytes = 8 * mesh.node_numbers.size() + 8 * mesh.coordinates.size();
        for (const ElementBlock& block : mesh.blocks) bytes += 8 * block.numbers.size() + 4 * block.nodes.size();
        // Sections that are the same for every mesh count too in a small file.
        constexpr std::int64_t kSections = 100;
        const auto size = std::int64_t(test::written(mesh, format).size());
        EXPECT_LE(formats::least_memory(size), std::int64_t(bytes) + kSections);
      }
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
