// Files on disk: names, endings, and never half a file.
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/base/utf8.h"
#include "core/formats/output_file.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;
using formats::OutputFile;
using test::Folder;

std::size_t files_in(const std::string& folder) {
  return std::size_t(std::distance(std::filesystem::directory_iterator(folder), {}));
}

TEST(FormatTable, NamesAreFoundAndListed) {
  EXPECT_EQ(formats::from_name("msh41-binary"), Format::Msh41Binary);
  const auto unknown = formats::from_name("stl");
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().kind, Error::Kind::BadOption);
  EXPECT_NE(unknown.error().sentence.find("msh22-binary"), std::string::npos);
}

TEST(FormatTable, EndingsDecide) {
  EXPECT_EQ(formats::for_output("a/b.vtu", Format::Auto, Format::Msh22), Format::Vtu);
  EXPECT_EQ(formats::for_output("b.MSH", Format::Auto, Format::Msh22), Format::Msh22);
  EXPECT_EQ(formats::for_output("b.msh", Format::Auto, Format::Auto), Format::Msh41Binary);
  EXPECT_EQ(formats::for_output("b.dat", Format::Msh41, Format::Auto), Format::Msh41);
  EXPECT_EQ(formats::for_output("/dev/null", Format::Auto, Format::Msh22), Format::Msh22);
  EXPECT_FALSE(formats::for_output("b.vtu", Format::Msh41, Format::Auto));
  EXPECT_FALSE(formats::for_output("b.msh", Format::Vtu, Format::Auto));
  EXPECT_FALSE(formats::for_output("b.stl", Format::Auto, Format::Msh22));
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

TEST(OutputFile, FollowsLinksAndKeepsRights) {
  const Folder folder;
  std::ofstream(folder.file("real")) << "old";
  std::filesystem::permissions(folder.file("real"), std::filesystem::perms(0640));
  std::filesystem::create_symlink("real", folder.file("second"));
  std::filesystem::create_symlink(folder.file("second"), folder.file("first"));
  auto file = OutputFile::open(folder.file("first"));
  ASSERT_TRUE(file) << file.error().sentence;
  EXPECT_TRUE(file->write("new"));
  EXPECT_EQ(test::slurp(folder.file("real")), "old");
  ASSERT_TRUE(file->commit());
  EXPECT_EQ(test::slurp(folder.file("real")), "new");
  EXPECT_EQ(std::filesystem::status(folder.file("real")).permissions(), std::filesystem::perms(0640));
  EXPECT_TRUE(std::filesystem::is_symlink(folder.file("first")) && std::filesystem::is_symlink(folder.file("second")));
  EXPECT_EQ(files_in(folder.path()), 3u);
}

TEST(OutputFile, WritesOverWhatIsMountedOnTheName) {
  const Folder folder;
  std::ofstream(folder.file("mounted")) << "something longer that was there";
  std::ofstream(folder.file("name"));
  constexpr int kNotAllowed = 77;
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    // In a mount table of the child's own, so that nothing is left to be unmounted.
    if (::unshare(CLONE_NEWNS) != 0 || ::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
        ::mount(folder.file("mounted").c_str(), folder.file("name").c_str(), nullptr, MS_BIND, nullptr) != 0)
      ::_exit(kNotAllowed);
    auto file = OutputFile::open(folder.file("name"));
    ::_exit(file && file->write("new") && file->commit() ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  if (WEXITSTATUS(status) == kNotAllowed) GTEST_SKIP() << "only root can mount here";
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_EQ(test::slurp(folder.file("mounted")), "new");
}

TEST(OutputFile, LinksInARingAreRefused) {
  const Folder folder;
  std::filesystem::create_symlink("b", folder.file("a"));
  std::filesystem::create_symlink("a", folder.file("b"));
  EXPECT_FALSE(OutputFile::open(folder.file("a")));
}

TEST(OutputFile, AFullDeviceIsAnOutputError) {
  auto file = OutputFile::open("/dev/full");
  ASSERT_TRUE(file) << file.error().sentence;
  EXPECT_FALSE(file->write("some"));
  const auto done = file->commit();
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().kind, Error::Kind::Output);
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
}

TEST(OutputFile, ALongNameIsNoObstacle) {
  const Folder folder;
  const std::string name = std::string(251, 'a') + ".msh";
  auto file = OutputFile::open(folder.file(name));
  ASSERT_TRUE(file) << file.error().sentence;
  ASSERT_TRUE(file->commit());
  EXPECT_TRUE(std::filesystem::exists(folder.file(name)));
}

TEST(Utf8, IsToldFromOtherBytes) {
  const std::vector<std::string> texts = {"", "\xc3\xa4", "\xe2\x82\xac", "\xf0\x9f\x98\x80"};
  const std::vector<std::string> others = {"W\xe4nde",         "\xc3", "\xc0\x80", "\xe0\x80\x80", "\xed\xa0\x80",
                                           "\xf4\x90\x80\x80", "\xff"};
  for (const std::string& text : texts) EXPECT_TRUE(is_utf8(text)) << text;
  for (const std::string& other : others) EXPECT_FALSE(is_utf8(other)) << as_utf8(other);
  EXPECT_EQ(as_utf8("W\xe4nde \xc3\xa4"), "W\\xe4nde \xc3\xa4");
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
