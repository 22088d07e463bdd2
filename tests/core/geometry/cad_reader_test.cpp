// What is kept of a reader that sends more than any model has: programs that stand in for it.
#include "core/geometry/cad_reader.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>

namespace varimesh::geometry {
namespace {

class CadReader : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(::testing::TempDir()) / ("varimesh_cad_reader_" + std::to_string(::getpid()));
    std::filesystem::create_directory(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  /// What is read with a reader that runs these commands of the shell.
  Expected<ReadModel> read(const std::string& commands) const {
    const std::filesystem::path reader = folder_ / "reader";
    std::ofstream(reader) << "#!/bin/sh\n" << commands << "\n";
    ::chmod(reader.c_str(), 0700);
    std::FILE* const file = std::tmpfile();
    auto model = read_in_child(reader, ReaderTask::Shape, ::fileno(file), "The model", 0);
    std::fclose(file);
    return model;
  }

 private:
  std::filesystem::path folder_;
};

TEST_F(CadReader, HandsOverWhatTheProgramSays) {
  const auto model = read("printf shape >&3; printf 'One.\\nTwo.\\n' >&4; printf '7 Lid\\n12 Left side\\n' >&6");
  ASSERT_TRUE(model) << model.error().sentence;
  EXPECT_EQ(model->made, "shape");
  EXPECT_EQ(model->notes, (std::vector<std::string>{"One.", "Two."}));
  EXPECT_EQ(model->names, (std::map<int, std::string>{{7, "Lid"}, {12, "Left side"}}));
}

TEST_F(CadReader, KeepsNoMoreSentencesThanAModelHas) {
  const auto model = read("yes 'A sentence.' | head -n 3000000 >&4");
  ASSERT_TRUE(model) << model.error().sentence;
  EXPECT_EQ(model->notes, std::vector<std::string>(20, "A sentence."));
  const auto long_line = read("head -c 9000000 /dev/zero >&4");
  ASSERT_TRUE(long_line) << long_line.error().sentence;
  ASSERT_EQ(long_line->notes.size(), 1u);
  EXPECT_LE(long_line->notes.front().size(), 1024u);
  EXPECT_TRUE(long_line->notes.front().starts_with("\\x00\\x00"));
}

TEST_F(CadReader, KeepsNoMoreNamesThanAModelHas) {
  const auto model = read("seq 1 300000 | sed 's/$/ face/' >&6");
  ASSERT_TRUE(model) << model.error().sentence;
  EXPECT_EQ(model->names.size(), 100'000u);
  EXPECT_TRUE(model->names.contains(1));
  const auto long_names = read("(printf '3 '; head -c 60000000 /dev/zero | tr '\\0' x; printf '\\n4 y\\n') >&6");
  ASSERT_TRUE(long_names) << long_names.error().sentence;
  ASSERT_EQ(long_names->names.size(), 1u);
  EXPECT_LE(long_names->names.at(3).size(), 80u);
  const auto no_faces = read("printf '0 none\\n-5 below\\nword\\n99999999999 beyond\\n8\\n' >&6");
  ASSERT_TRUE(no_faces) << no_faces.error().sentence;
  EXPECT_TRUE(no_faces->names.empty());
}

TEST_F(CadReader, RefusesInOneLineOfBoundedLength) {
  const auto model = read("yes 'It is damaged.' | head -n 3000000 >&4; exit 3");
  ASSERT_FALSE(model);
  EXPECT_EQ(model.error().kind, Error::Kind::BadInput);
  EXPECT_TRUE(model.error().sentence.starts_with("The model cannot be used: It is damaged."));
  EXPECT_LE(model.error().sentence.size(), 1100u);
  EXPECT_EQ(std::ranges::count(model.error().sentence, '\n'), 0);
}

}  // namespace
}  // namespace varimesh::geometry
