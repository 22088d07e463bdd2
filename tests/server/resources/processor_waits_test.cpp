// Times of threads, as the system would write them.
#include "server/resources/processor_waits.h"

#include <gtest/gtest.h>
#include <sched.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

namespace varimesh::server {
namespace {

namespace fs = std::filesystem;

class ProcessorWaitsOfFiles : public ::testing::Test {
 protected:
  void SetUp() override { fs::create_directories(tasks_); }
  void TearDown() override { fs::remove_all(tasks_); }
  /// Milliseconds that a thread has run and waited.
  void write(const std::string& thread, long ran, long waited) {
    fs::create_directories(tasks_ / thread);
    std::ofstream(tasks_ / thread / "schedstat") << ran << "000000 " << waited << "000000 7\n";
  }

  const fs::path tasks_ = fs::temp_directory_path() / ("processor_waits_" + std::to_string(::getpid()));
};

TEST_F(ProcessorWaitsOfFiles, SayWhetherTheThreadsHadToWait) {
  write("1", 100, 100);
  write("2", 50, 0);
  ProcessorWaits waits(tasks_);
  EXPECT_FALSE(waits.crowded()) << "what was before does not count";
  write("2", 150, 20);
  EXPECT_FALSE(waits.crowded()) << "20 ms of 100";
  write("1", 150, 140);
  EXPECT_TRUE(waits.crowded()) << "40 ms of 50";
  write("1", 160, 140);
  EXPECT_TRUE(waits.crowded()) << "10 ms are too few to change the answer";
  write("1", 200, 140);
  EXPECT_FALSE(waits.crowded());
}

TEST_F(ProcessorWaitsOfFiles, LeaveOutAThreadThatHasEnded) {
  write("1", 100, 100);
  write("2", 100, 100);
  ProcessorWaits waits(tasks_);
  fs::remove_all(tasks_ / "2");
  EXPECT_FALSE(waits.crowded());
  write("1", 120, 120);
  EXPECT_TRUE(waits.crowded());
}

TEST(ProcessorWaits, NeverCrowdedWithoutFiles) {
  ProcessorWaits waits("/nowhere");
  EXPECT_FALSE(waits.crowded());
}

TEST(ProcessorWaits, TwoThreadsOnOneProcessorWaitForEachOther) {
  if (!fs::exists("/proc/self/schedstat")) GTEST_SKIP() << "the system does not count";
  cpu_set_t all, first;
  ASSERT_EQ(sched_getaffinity(0, sizeof all, &all), 0);
  int processor = 0;
  while (!CPU_ISSET(processor, &all)) ++processor;
  CPU_ZERO(&first);
  CPU_SET(processor, &first);
  ProcessorWaits waits;
  std::atomic<bool> ended = false;
  const auto compute = [&] {
    sched_setaffinity(0, sizeof first, &first);  // of this thread
    while (!ended) {
    }
  };
  std::thread one(compute), other(compute);
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  EXPECT_TRUE(waits.crowded());
  ended = true;
  one.join();
  other.join();
}

}  // namespace
}  // namespace varimesh::server
