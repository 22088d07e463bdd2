// The log, whose lines people and programs read.
#include "server/log.h"

#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <algorithm>

namespace varimesh::server {
namespace {

TEST(Log, WritesOneShortLineWhateverAClientHasSent) {
  const auto before = spdlog::default_logger();
  ::testing::internal::CaptureStderr();
  ASSERT_TRUE(start_log("info"));
  spdlog::info("{} {}", "jobs/1",
               "FAILED: The name 'a\n2026-01-01T00:00:00.000+00:00 info forged\x1b[2J" + std::string(100'000, 'x'));
  const std::string lines = ::testing::internal::GetCapturedStderr();
  spdlog::set_default_logger(before);
  EXPECT_EQ(std::count(lines.begin(), lines.end(), '\n'), 1) << lines;
  EXPECT_EQ(lines.find('\x1b'), std::string::npos);
  EXPECT_NE(lines.find("jobs/1 FAILED"), std::string::npos) << lines;
  EXPECT_LT(lines.size(), 1200u);
}

}  // namespace
}  // namespace varimesh::server
