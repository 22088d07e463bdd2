// Newton's method on a card that a library in the driver's place has: its bits, and whole results after each fault.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

#include "core/device/cpu_device.h"
#include "core/device_kernels/cell_modules.h"
#include "tests/core/device/fake_card.h"
#include "tests/core/solvers/newton/newton_cases.h"

namespace varimesh {
namespace {

class NewtonOnACard : public ::testing::Test {
 protected:
  NewtonOnACard() : mesh_(mesh_of({"", testing::Filling::Tetrahedra, 3, 0.03})) {}
  void SetUp() override {
    if (device::solver_kernels(3).packed.empty())
      GTEST_SKIP() << "this build has no kernels for a card, because there was no clang";
  }
  void TearDown() override { unsetenv("FAKE_CUDA"); }

  static device::RunDevice card(const std::string& state) {
    auto card = testing::fake_card(state);
    EXPECT_TRUE(card) << card.error().sentence;
    return device::RunDevice(std::move(*card));
  }
  /// Steps with this device; the positions after each.
  std::vector<std::vector<double>> steps(device::RunDevice& device, int count) {
    PreparedNewton prepared(mesh_, {});
    std::optional<Newton> newton;
    prepared.begin(newton, device);
    std::vector<std::vector<double>> positions;
    for (int step = 0; step < count; ++step) {
      prepared.step(*newton);
      positions.push_back(prepared.problem_.positions);
      EXPECT_EQ(prepared.seen_.invalid, 0);
    }
    return positions;
  }

  HighOrderMesh mesh_;
};

TEST_F(NewtonOnACard, HasTheProcessorsBits) {
  device::RunDevice here = card(""), there(device::make_cpu_device());
  EXPECT_EQ(steps(here, 3), steps(there, 3));
  EXPECT_EQ(here.done_on(), "Fake Card 1");
}

TEST_F(NewtonOnACard, GoesOnOnTheProcessorIfItCannotBegin) {
  device::RunDevice none;
  const auto expected = steps(none, 2);
  for (const char* state : {"memory=20000", "memory=200000", "load=218", "load=222", "lost=1", "launch=701"}) {
    SCOPED_TRACE(state);
    device::RunDevice device = card(state);
    EXPECT_EQ(steps(device, 2), expected);
    ASSERT_TRUE(device.fault());
    const bool may_have_room_later = device.fault()->kind == device::Fault::Kind::OutOfMemory;
    EXPECT_EQ(device.get() != nullptr, may_have_room_later);
    EXPECT_EQ(device.has_ended(), !may_have_room_later);
    EXPECT_TRUE(device.done_on().empty());
    EXPECT_EQ(device.fault()->sentence.back(), '.');
  }
}

TEST_F(NewtonOnACard, GoesOnFromTheLastStepIfItIsLost) {
  device::RunDevice whole = card("");
  const auto expected = steps(whole, 2);
  // Steps on the processor from where the first step on the device ends.
  const auto from_first = [&] {
    PreparedNewton prepared(mesh_, {});
    device::RunDevice device = card("");
    std::optional<Newton> newton;
    prepared.begin(newton, device);
    prepared.step(*newton);
    return prepared.problem_.positions;
  };
  ASSERT_EQ(from_first(), expected.front());
  int lost_in_second = 0, lost_in_first = 0;
  for (int launch = 5; launch < 3000; launch += 97)
    for (const char* how : {"lost=", "lost_at_wait="}) {
      device::RunDevice device = card(how + std::to_string(launch));
      SCOPED_TRACE(how + std::to_string(launch));
      const auto positions = steps(device, 2);
      if (!device.fault()) continue;
      EXPECT_EQ(device.fault()->kind, device::Fault::Kind::Lost);
      if (device.done_on().empty()) {
        ++lost_in_first;
        continue;
      }
      ++lost_in_second;
      EXPECT_EQ(positions.front(), expected.front());
      double largest = 0;
      for (std::size_t i = 0; i < positions.back().size(); ++i)
        largest = std::max(largest, std::abs(positions.back()[i] - expected.back()[i]));
      EXPECT_LT(largest, 1e-3);
    }
  EXPECT_GT(lost_in_first, 3);
  EXPECT_GT(lost_in_second, 3);
}

}  // namespace
}  // namespace varimesh
