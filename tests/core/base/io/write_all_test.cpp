// All bytes are written, or the caller is told why not.
#include "core/base/io/write_all.h"

#include <fcntl.h>
#include <gtest/gtest.h>

#include <csignal>
#include <string>
#include <thread>

namespace varimesh {
namespace {

TEST(WriteAll, WritesMoreThanAPipeHolds) {
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  std::string bytes;
  for (int i = 0; bytes.size() < (1U << 20); ++i) bytes += std::to_string(i);
  std::string received;
  std::thread reader([&] {
    char piece[1 << 12];
    for (ssize_t n = 0; (n = ::read(ends[0], piece, sizeof piece)) > 0;)
      received.append(piece, static_cast<std::size_t>(n));
  });
  EXPECT_TRUE(write_all(ends[1], bytes));
  ::close(ends[1]);
  reader.join();
  ::close(ends[0]);
  EXPECT_EQ(received, bytes);
}

TEST(WriteAll, NothingIsAlwaysWritten) { EXPECT_TRUE(write_all(-1, "")); }

TEST(WriteAll, FailsOnAFullDevice) {
  const int full = ::open("/dev/full", O_WRONLY | O_CLOEXEC);
  ASSERT_GE(full, 0);
  EXPECT_FALSE(write_all(full, "some"));
  EXPECT_EQ(errno, ENOSPC);
  ::close(full);
}

TEST(WriteAll, FailsOnABrokenPipe) {
  const auto before = std::signal(SIGPIPE, SIG_IGN);
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  ::close(ends[0]);
  EXPECT_FALSE(write_all(ends[1], "some"));
  EXPECT_EQ(errno, EPIPE);
  ::close(ends[1]);
  std::signal(SIGPIPE, before);
}

}  // namespace
}  // namespace varimesh
