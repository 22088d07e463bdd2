// The program for HDF5 files has limits, and what it answers is checked.
#include "core/formats/hdf5/process.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "core/formats/formats.h"
#include "tests/core/hdf/program.h"
#include "tests/core/support/formats.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/samples.h"

namespace varimesh {
namespace {

using formats::Format;
using testing::curved_grid;
using testing::Filling;

std::string some(Format format) { return test::written(curved_grid(Filling::Hexahedra, 2), format); }

/// A script in the program's place.
class InPlaceOfTheProgram {
 public:
  explicit InPlaceOfTheProgram(const std::string& script) : program_(std::getenv("VARIMESH_HDF5")) {
    const std::string file = folder_.file("program");
    std::ofstream(file) << "#!/bin/bash\n" << script << "\n";
    std::filesystem::permissions(file, std::filesystem::perms::owner_all);
    ::setenv("VARIMESH_HDF5", file.c_str(), 1);
  }
  ~InPlaceOfTheProgram() { ::setenv("VARIMESH_HDF5", program_.c_str(), 1); }
  InPlaceOfTheProgram(const InPlaceOfTheProgram&) = delete;
  InPlaceOfTheProgram& operator=(const InPlaceOfTheProgram&) = delete;

 private:
  test::Folder folder_;
  std::string program_;
};

TEST(Hdf5Process, ACrashEndsOnlyTheProgram) {
  NEEDS_HDF5();
  const std::string whole = some(Format::Hopr);
  {
    const InPlaceOfTheProgram crash("kill -SEGV $$");
    EXPECT_SAYS(whole, "HDF5 crashed (signal 11), so the file is probably damaged");
  }
  {
    const InPlaceOfTheProgram slow("kill -XCPU $$");
    EXPECT_SAYS(whole, "HDF5 took more than");
  }
  EXPECT_SAYS(whole, "it was read");
}

// What the program answers is checked: it may have been taken over by the file that it reads.
TEST(Hdf5Process, WrongAnswersAreRefused) {
  NEEDS_HDF5();
  const std::string whole = some(Format::Hopr);
  // It gets an order of 24 bytes and the file, and says that a mesh of HOPR follows: an answer of 16 bytes.
  const std::string taken = "head -c " + std::to_string(24 + whole.size()) + " <&3 >/dev/null; ";
  const auto says = [&](const std::string& answer, const std::string& words) {
    SCOPED_TRACE(answer);
    const InPlaceOfTheProgram liar(taken + answer);
    EXPECT_SAYS(whole, words);
  };
  const std::string wrong = "HDF5 gave an answer of the wrong size, so the file is probably damaged";
  says("head -c 99999 /dev/zero >&3", wrong);  // a mesh of no format
  says(R"(printf '\7\0\0\0\0\0\0\0\377\377\377\377\377\377\377\377' >&3)", wrong);
  says(R"(printf '\1\0\0\0\0\0\0\0\0\0\1\0\0\0\0\0' >&3)", wrong);  // a sentence of 64 KiB
  says(R"(printf '\1\0\0\0\0\0\0\0\6\0\0\0\0\0\0\0no\33[m.' >&3)", "no?[m.");
  const std::string hopr = R"((printf '\0\0\0\0\12\0\0\0\0\0\0\0\0\0\0\0'; )", end = " >&3";
  says(hopr + "head -c 99999 /dev/zero)" + end, wrong);  // an empty mesh
  says(hopr + "head -c 99999 /dev/zero | tr '\\0' '\\1')" + end, "takes more than 8 times the memory of the file");
  // 2⁵⁶ coordinates, and one.
  says(hopr + R"(printf '\3\0\0\0\1\0\0\0\0\0\0\0\0\0\0\1'))" + end, "takes more than 8 times the memory of the file");
  says(hopr + R"(printf '\3\0\0\0\1\0\0\0\1'; head -c 99999 /dev/zero))" + end, "gave a mesh that is not whole");
}

TEST(Hdf5Process, EndsWhenReadingIsStopped) {
  NEEDS_HDF5();
  const std::string whole = some(Format::Hopr);
  const InPlaceOfTheProgram hanging("exec sleep 100");
  const StopToken stop([] { return true; });
  const auto file = formats::read(whole, 1, &stop);
  ASSERT_FALSE(file);
  EXPECT_NE(file.error().sentence.find("was stopped before its end"), std::string::npos);
}

TEST(Hdf5Process, LeavesNoFilesOpen) {
  NEEDS_HDF5();
  const auto count = [] {
    return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), std::filesystem::directory_iterator());
  };
  const std::string whole = some(Format::Hopr);
  const auto before = count();
  for (int k = 0; k < 5; ++k) {
    (void)formats::read(whole);
    (void)formats::read(whole.substr(0, 1000));
    (void)some(Format::Cgns);
  }
  EXPECT_EQ(count(), before);
}

}  // namespace
}  // namespace varimesh
