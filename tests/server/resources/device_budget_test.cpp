// Waiting for a device.
#include "server/resources/device_budget.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

namespace varimesh::server {
namespace {

bool gives_up() { return true; }
bool waits() { return false; }

TEST(DeviceBudget, HasNoneByDefault) {
  DeviceBudget budget;
  EXPECT_EQ(budget.devices(), 0);
  EXPECT_EQ(budget.take_free(), nullptr);
}

TEST(DeviceBudget, LendsEachDeviceToOneJob) {
  DeviceBudget budget({"0", "GPU-b"});
  auto first = budget.take_free();
  const auto second = budget.take_free();
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->device(), "0");
  EXPECT_EQ(second->device(), "GPU-b");
  EXPECT_EQ(budget.busy(), 2);
  EXPECT_EQ(budget.take_free(), nullptr);
  EXPECT_EQ(budget.take(gives_up), nullptr);
  first.reset();
  EXPECT_EQ(budget.busy(), 1);
  first = budget.take(waits);
  ASSERT_TRUE(first);
  EXPECT_EQ(first->device(), "0");
}

TEST(DeviceBudget, SharesADeviceIfTheOperatorSaysSo) {
  DeviceBudget budget({"0", "1"}, 2);
  std::vector<std::unique_ptr<DeviceBudget::Place>> places;
  std::string order;
  while (auto place = budget.take_free()) {
    order += place->device();
    places.push_back(std::move(place));
  }
  EXPECT_EQ(order, "0101") << "the device that the fewest jobs have";
  EXPECT_EQ(budget.busy(), 2);
  EXPECT_EQ(budget.jobs(), 4);
}

TEST(DeviceBudgetConcurrency, ServesThoseThatWaitInTheirOrder) {
  DeviceBudget budget({"0"});
  auto held = budget.take_free();
  std::atomic<int> waiting = 0;
  std::vector<int> served;
  std::vector<std::thread> jobs;
  for (int job = 0; job < 3; ++job) {
    jobs.emplace_back([&, job] {
      bool asked = false;
      const auto place = budget.take([&] {
        if (!std::exchange(asked, true)) ++waiting;
        return false;
      });
      served.push_back(job);  // while it has the device, nobody else is here
    });
    while (waiting <= job) std::this_thread::yield();
  }
  EXPECT_EQ(budget.take_free(), nullptr);
  held.reset();
  for (std::thread& job : jobs) job.join();
  EXPECT_EQ(served, (std::vector<int>{0, 1, 2}));
  EXPECT_EQ(budget.busy(), 0);
}

TEST(DeviceBudgetConcurrency, NeverLendsADeviceTwice) {
  DeviceBudget budget({"0", "1"});
  std::atomic<int> having = 0, most = 0;
  std::vector<std::thread> jobs;
  for (int job = 0; job < 6; ++job)
    jobs.emplace_back([&] {
      for (int i = 0; i < 200; ++i) {
        const auto place = budget.take(waits);
        const int now = ++having;
        for (int seen = most; now > seen && !most.compare_exchange_weak(seen, now);) {
        }
        --having;
      }
    });
  for (std::thread& job : jobs) job.join();
  EXPECT_LE(most, 2);
  EXPECT_EQ(budget.jobs(), 0);
}

}  // namespace
}  // namespace varimesh::server
