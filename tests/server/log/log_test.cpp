// The log, whose lines people and programs read.
#include "server/log/log.h"

#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "server/log/line_rate.h"

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

TEST(LineRate, CountsWhatItLeavesOut) {
  LineRate::Time now{};
  LineRate rate(2, [&] { return now; });
  EXPECT_TRUE(rate.take("unknown") && rate.take("unknown"));
  EXPECT_FALSE(rate.take("unknown") || rate.take("unknown") || rate.take("unknown"));
  EXPECT_TRUE(rate.take("missing")) << "another kind";
  EXPECT_TRUE(rate.left_out().empty()) << "the minute is not over";
  now += std::chrono::minutes(1);
  EXPECT_FALSE(rate.take("unknown")) << "the count comes first";
  EXPECT_EQ(rate.left_out(), (std::map<std::string, std::int64_t>{{"unknown", 4}}));
  EXPECT_TRUE(rate.left_out().empty());
  EXPECT_TRUE(rate.take("unknown") && rate.take("missing") && rate.take("missing"));
}

/// What is logged while `work` runs, line by line.
std::vector<nlohmann::json> logged(const std::function<void()>& work) {
  const auto before = spdlog::default_logger();
  ::testing::internal::CaptureStderr();
  EXPECT_TRUE(start_log("info", "json"));
  work();
  std::istringstream text(::testing::internal::GetCapturedStderr());
  spdlog::set_default_logger(before);
  std::vector<nlohmann::json> lines;
  for (std::string line; std::getline(text, line);) lines.push_back(nlohmann::json::parse(line));
  return lines;
}

TEST(Log, WritesObjectsWithTheFieldsOfTheThread) {
  const auto lines = logged([] {
    const LogScope outer({.job = "jobs/1", .attempt = 2, .owner = "ann"});
    spdlog::warn("a \"quoted\" line\nand \xff bytes");
    std::thread([] { spdlog::info("elsewhere"); }).join();
    {
      const LogScope inner({.job = "jobs/2", .trace_id = "abc"});
      spdlog::info("inside");
    }
    spdlog::info("outside");
  });
  ASSERT_EQ(lines.size(), 4u);
  EXPECT_EQ(lines[0]["level"], "warning");
  EXPECT_EQ(lines[0]["message"], "a \"quoted\" line\\x0aand \\xff bytes");
  EXPECT_EQ(lines[0]["job"], "jobs/1");
  EXPECT_EQ(lines[0]["attempt"], 2);
  EXPECT_EQ(lines[0]["owner"], "ann");
  EXPECT_FALSE(lines[0].contains("trace_id"));
  EXPECT_FALSE(lines[1].contains("job")) << "another thread has fields of its own";
  EXPECT_EQ(lines[2]["job"], "jobs/2");
  EXPECT_EQ(lines[2]["owner"], "ann");
  EXPECT_EQ(lines[2]["trace_id"], "abc");
  EXPECT_EQ(lines[3]["job"], "jobs/1");
  EXPECT_FALSE(lines[3].contains("trace_id"));
}

TEST(Log, AuditSaysWhoDidWhat) {
  const auto lines =
      logged([] { audit("cancel", "jobs/1", "RIGHT_MISSING", {.owner = "bob", .address = "10.0.0.7"}); });
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0]["message"], "audit: cancel jobs/1 by bob at 10.0.0.7: RIGHT_MISSING");
  EXPECT_EQ(lines[0]["audit"], "cancel");
  EXPECT_EQ(lines[0]["outcome"], "RIGHT_MISSING");
  EXPECT_EQ(lines[0]["owner"], "bob");
}

TEST(Log, HasTwoFormats) {
  EXPECT_FALSE(start_log("info", "xml"));
  EXPECT_FALSE(start_log("loud", "json"));
}

}  // namespace
}  // namespace varimesh::server
