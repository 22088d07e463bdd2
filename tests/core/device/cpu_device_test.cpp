// The processor as a device.
#include "core/device/cpu_device.h"

#include <gtest/gtest.h>

#include "tests/core/device/doubling.h"

namespace varimesh::device {
namespace {

TEST(CpuDevice, RunsEveryThreadOfALaunch) {
  const auto cpu = make_cpu_device();
  const auto module = cpu->load({"doubling", {}, testing::kDoubling});
  ASSERT_TRUE(module);
  for (const std::int32_t count : {1, 127, 128, 129, 1000}) {
    const auto numbers = testing::doubled(*cpu, **module, count);
    ASSERT_TRUE(numbers) << numbers.error().sentence;
    for (std::size_t i = 0; i < numbers->size(); ++i) EXPECT_EQ((*numbers)[i], 2.0 * static_cast<double>(i));
  }
}

TEST(CpuDevice, SaysWhichKernelIsMissing) {
  const auto cpu = make_cpu_device();
  const auto module = cpu->load({"doubling", {}, testing::kDoubling});
  ASSERT_TRUE(module);
  const auto kernel = (*module)->kernel("halving");
  ASSERT_FALSE(kernel);
  EXPECT_EQ(kernel.error().kind, Fault::Kind::BadKernels);
  EXPECT_EQ(kernel.error().sentence, "The module doubling has no kernel halving.");
}

TEST(CpuDevice, RefusesMoreMemoryThanThereIs) {
  const auto cpu = make_cpu_device();
  const auto buffer = cpu->allocate(std::size_t{1} << 60);
  ASSERT_FALSE(buffer);
  EXPECT_EQ(buffer.error().kind, Fault::Kind::OutOfMemory);
}

TEST(CpuDevice, BuffersCanMove) {
  const auto cpu = make_cpu_device();
  const std::vector<int> numbers{1, 2, 3};
  auto first = cpu->allocate_with<int>(numbers);
  ASSERT_TRUE(first);
  Buffer second = std::move(*first);
  EXPECT_EQ(first->bytes(), 0U);
  EXPECT_EQ(first->as<int>(), nullptr);
  std::vector<int> back(3);
  ASSERT_TRUE(second.download<int>(back));
  EXPECT_EQ(back, numbers);
  EXPECT_EQ(cpu->allocate(0)->bytes(), 0U);
}

}  // namespace
}  // namespace varimesh::device
