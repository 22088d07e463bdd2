// Single frames, and files of frames.
#include "server/meshes/zstd.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "core/base/io/write_all.h"
#include "tests/server/meshes/stores.h"

namespace varimesh::server::testing {
namespace {

/// A file without a name.
int new_file() {
  std::string name = ::testing::TempDir() + "varimesh-zstd-XXXXXX";
  const int file = ::mkostemp(name.data(), O_CLOEXEC);
  ::unlink(name.c_str());
  return file;
}

TEST(ZstdFrame, PreservesBytes) {
  const std::string bytes = long_text(1000);
  const std::string frame = zstd_compress(bytes);
  ASSERT_FALSE(frame.empty());
  EXPECT_LT(frame.size(), bytes.size());
  std::string back;
  ASSERT_TRUE(zstd_decompress(frame, bytes.size(), &back));
  EXPECT_EQ(back, bytes);
}

TEST(ZstdFrame, IsEmptyIfItWouldNotBeSmaller) { EXPECT_TRUE(zstd_compress("short").empty()); }

TEST(ZstdFrame, IsRefusedIfItIsTooLargeCutOrFollowedByMore) {
  const std::string bytes = long_text(1000), frame = zstd_compress(bytes);
  std::string back;
  EXPECT_FALSE(zstd_decompress(frame, bytes.size() - 1, &back));
  EXPECT_FALSE(zstd_decompress(frame.substr(0, frame.size() - 1), bytes.size(), &back));
  EXPECT_FALSE(zstd_decompress(frame + frame, 2 * bytes.size(), &back));
  EXPECT_FALSE(zstd_decompress("no frame", 1000, &back));
}

TEST(ZstdFile, PreservesTheContent) {
  const std::string bytes = long_text(50'000);
  const int from = new_file(), to = new_file();
  ASSERT_TRUE(write_all(from, bytes));
  ASSERT_EQ(compress_file(from, to, [] { return false; }), Compression::Smaller);
  ::close(from);
  const auto file = ZstdFile::open(to);
  ASSERT_NE(file, nullptr);
  EXPECT_EQ(file->size(), static_cast<std::int64_t>(bytes.size()));
  EXPECT_EQ(file->frames(), (bytes.size() + kFrameBytes - 1) / kFrameBytes);
  std::string all, content;
  for (std::size_t i = 0; i < file->frames(); ++i) {
    ASSERT_TRUE(file->read_content(i, &content));
    all += content;
  }
  EXPECT_EQ(all, bytes);
}

TEST(ZstdFile, RefusesOtherFiles) {
  const int file = new_file();
  ASSERT_TRUE(write_all(file, long_text(1000)));
  EXPECT_EQ(ZstdFile::open(file), nullptr);
}

}  // namespace
}  // namespace varimesh::server::testing
