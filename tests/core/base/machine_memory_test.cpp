// The memory that the machine and its control groups allow.
#include "core/base/machine_memory.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <string>

namespace varimesh {
namespace {

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

}  // namespace
}  // namespace varimesh
