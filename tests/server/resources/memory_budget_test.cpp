// Waiting for memory, and the memory that the machine and its control groups allow.
#include "server/resources/memory_budget.h"

#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

namespace varimesh::server {
namespace {

TEST(MemoryBudget, KnowsWhichRequestsCanNeverFit) {
  EXPECT_FALSE(MemoryBudget(100).can_ever_fit(101));
  EXPECT_TRUE(MemoryBudget(100).can_ever_fit(100));
  EXPECT_TRUE(MemoryBudget(0).can_ever_fit(std::int64_t{1} << 60));
}

/// The files in /proc and /sys of a process in a control group.
class MachineMemory : public ::testing::Test {
 protected:
  MachineMemory() {
    std::string name = ::testing::TempDir() + "varimesh-machine-XXXXXX";
    root_ = ::mkdtemp(name.data());
    all_ = machine_memory(root_);
  }
  ~MachineMemory() override { std::filesystem::remove_all(root_); }
  void write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((root_ / name).parent_path());
    std::ofstream(root_ / name) << text << '\n';
  }

  std::filesystem::path root_;
  std::int64_t all_ = 0;
};

TEST_F(MachineMemory, IsThatOfTheMachineWithoutLimits) {
  EXPECT_GT(all_, 0);
  write("proc/self/cgroup", "0::/system.slice/varimeshd.service");
  write("sys/fs/cgroup/system.slice/varimeshd.service/memory.max", "max");
  EXPECT_EQ(machine_memory(root_), all_);
}

TEST_F(MachineMemory, IsTheLimitOfTheService) {
  write("proc/self/cgroup", "0::/system.slice/varimeshd.service");
  write("sys/fs/cgroup/system.slice/varimeshd.service/memory.max", "1000000");
  write("sys/fs/cgroup/system.slice/other.service/memory.max", "10");
  EXPECT_EQ(machine_memory(root_), 900'000);
  write("sys/fs/cgroup/system.slice/varimeshd.service/memory.high", "500000");
  EXPECT_EQ(machine_memory(root_), 450'000) << "above memory.high the system slows the process down";
}

TEST_F(MachineMemory, IsTheLimitOfAParentControlGroup) {
  write("proc/self/cgroup", "0::/user.slice/a/b");
  write("sys/fs/cgroup/user.slice/memory.max", "100000");
  write("sys/fs/cgroup/user.slice/a/b/memory.max", "1000000");
  EXPECT_EQ(machine_memory(root_), 90'000);
}

TEST_F(MachineMemory, IsTheLimitOfTheContainer) {
  write("proc/self/cgroup", "0::/");
  write("sys/fs/cgroup/memory.max", "2000000");
  EXPECT_EQ(machine_memory(root_), 1'800'000);
}

TEST_F(MachineMemory, IsTheLimitOfAVersion1ControlGroup) {
  write("proc/self/cgroup", "5:cpu,cpuacct:/else\n4:hugetlb,memory:/docker/1\n0::/");
  write("sys/fs/cgroup/memory/docker/1/memory.limit_in_bytes", "3000000");
  write("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712");
  EXPECT_EQ(machine_memory(root_), 2'700'000);
}

TEST(MemoryBudgetConcurrency, NeverExceedsTheLimitAndKeepsTheOrder) {
  MemoryBudget budget(100);
  std::atomic<int> taken = 0, most = 0;
  ASSERT_TRUE(budget.take(60, [] { return false; }));
  std::atomic<bool> large_has_it = false, asked = false;
  std::thread large([&] {
    EXPECT_TRUE(budget.take(100, [&] {
      asked = true;
      return false;
    }));
    large_has_it = true;
    budget.give_back(100);
  });
  while (!asked) std::this_thread::yield();
  EXPECT_FALSE(budget.take(10, [] { return true; })) << "it would have fitted, but another was first";
  EXPECT_FALSE(large_has_it);
  budget.give_back(60);
  large.join();
  std::vector<std::thread> jobs;
  for (int job = 0; job < 4; ++job)
    jobs.emplace_back([&, job] {
      for (int i = 0; i < 200; ++i) {
        const int bytes = 20 + (i * 7 + job) % 60;
        ASSERT_TRUE(budget.take(bytes, [] { return false; }));
        const int now = taken += bytes;
        for (int seen = most; now > seen && !most.compare_exchange_weak(seen, now);) {
        }
        taken -= bytes;
        budget.give_back(bytes);
      }
    });
  for (std::thread& job : jobs) job.join();
  EXPECT_LE(most, 100);
}

}  // namespace
}  // namespace varimesh::server
