// Threads and memory, shared by jobs that come and go.
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "server/jobs/memory_budget.h"
#include "server/jobs/thread_shares.h"

namespace varimesh::server {
namespace {

TEST(ThreadShares, LendsToWhoComesAndGivesBack) {
  ThreadShares shares(8);
  const auto large = shares.take(8);
  EXPECT_EQ(large->threads(), 8);
  {
    const auto small = shares.take(1), other = shares.take(8);
    EXPECT_EQ(small->threads(), 1);
    EXPECT_EQ(large->threads(), 4);
    EXPECT_EQ(other->threads(), 3);
  }
  EXPECT_EQ(large->threads(), 8);
}

TEST(ThreadShares, LendsWhatRests) {
  ThreadShares shares(4);
  const auto works = shares.take(4), waits = shares.take(4);
  EXPECT_EQ(works->threads(), 2);
  waits->rest(true);
  EXPECT_EQ(works->threads(), 4);
  EXPECT_EQ(shares.take(1)->threads(), 1) << "others come and go meanwhile";
  waits->rest(false);
  EXPECT_EQ(works->threads() + waits->threads(), 4);
}

TEST(ThreadShares, GivesEverybodyOneAtLeast) {
  ThreadShares shares(2);
  const auto a = shares.take(2), b = shares.take(2), c = shares.take(2);
  EXPECT_EQ(a->threads() + b->threads() + c->threads(), 3);
}

TEST(ThreadSharesConcurrency, NeverGivesMoreThanThereAre) {
  ThreadShares shares(6);
  std::atomic<int> most = 0;
  std::vector<std::thread> jobs;
  for (int job = 0; job < 4; ++job)
    jobs.emplace_back([&, job] {
      for (int i = 0; i < 500; ++i) {
        const auto share = shares.take(1 + (i + job) % 6);
        if (share->threads() > most) most = share->threads();
      }
    });
  for (std::thread& job : jobs) job.join();
  EXPECT_LE(most, 6);
  EXPECT_EQ(shares.take(6)->threads(), 6);
}

TEST(MemoryBudget, KnowsWhatCanNeverFit) {
  EXPECT_FALSE(MemoryBudget(100).can_ever_fit(101));
  EXPECT_TRUE(MemoryBudget(100).can_ever_fit(100));
  EXPECT_TRUE(MemoryBudget(0).can_ever_fit(std::int64_t{1} << 60));
}

/// A machine's files as a process in a control group sees them.
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

TEST_F(MachineMemory, IsAllWhereNothingLimitsIt) {
  EXPECT_GT(all_, 0);
  write("proc/self/cgroup", "0::/system.slice/varimeshd.service");
  write("sys/fs/cgroup/system.slice/varimeshd.service/memory.max", "max");
  EXPECT_EQ(machine_memory(root_), all_);
}

TEST_F(MachineMemory, IsWhatItsServiceMayHave) {
  write("proc/self/cgroup", "0::/system.slice/varimeshd.service");
  write("sys/fs/cgroup/system.slice/varimeshd.service/memory.max", "1000000");
  write("sys/fs/cgroup/system.slice/other.service/memory.max", "10");
  EXPECT_EQ(machine_memory(root_), 900'000);
  write("sys/fs/cgroup/system.slice/varimeshd.service/memory.high", "500000");
  EXPECT_EQ(machine_memory(root_), 450'000) << "beyond it the system slows the process down";
}

TEST_F(MachineMemory, IsWhatAGroupRoundItMayHave) {
  write("proc/self/cgroup", "0::/user.slice/a/b");
  write("sys/fs/cgroup/user.slice/memory.max", "100000");
  write("sys/fs/cgroup/user.slice/a/b/memory.max", "1000000");
  EXPECT_EQ(machine_memory(root_), 90'000);
}

TEST_F(MachineMemory, IsThatOfTheContainer) {
  write("proc/self/cgroup", "0::/");
  write("sys/fs/cgroup/memory.max", "2000000");
  EXPECT_EQ(machine_memory(root_), 1'800'000);
}

TEST_F(MachineMemory, IsThatOfAnOldControlGroup) {
  write("proc/self/cgroup", "5:cpu,cpuacct:/else\n4:hugetlb,memory:/docker/1\n0::/");
  write("sys/fs/cgroup/memory/docker/1/memory.limit_in_bytes", "3000000");
  write("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712");
  EXPECT_EQ(machine_memory(root_), 2'700'000);
}

TEST(MemoryBudgetConcurrency, NeverGivesMoreThanThereIsAndLetsNobodyOvertake) {
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
  EXPECT_FALSE(budget.take(10, [] { return true; })) << "it would have fitted, but others were first";
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
