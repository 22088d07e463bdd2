// What the descent minimises on a card that a library in the driver's place has: the processor's bits, and a fault as
// an exception that leaves the nodes where the last step has put them.
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "core/device/cpu_device.h"
#include "core/device_kernels/cell_modules.h"
#include "core/solvers/descent/on_device/descent_check.h"
#include "core/solvers/newton_method.h"
#include "tests/core/device/fake_card.h"
#include "tests/core/solvers/descent/on_device/descent_cases.h"

namespace varimesh {
namespace {

class DescentOnACard : public ::testing::Test {
 protected:
  void SetUp() override {
    if (device::descent_kernels(3).packed.empty())
      GTEST_SKIP() << "this build has no kernels for a card, because there was no clang";
  }
  void TearDown() override { unsetenv("FAKE_CUDA"); }

  static std::unique_ptr<device::Device> card(const std::string& state) {
    auto card = testing::fake_card(state);
    EXPECT_TRUE(card) << card.error().sentence;
    return std::move(*card);
  }
  /// The positions before the first step and after each one. If the device fails, they end there, with its fault.
  struct Steps {
    std::vector<std::vector<double>> positions;
    std::optional<device::Fault> fault;
  };
  static Steps steps(device::Device& device, int count) {
    PreparedDescent bench({testing::Filling::Tetrahedra, 3});
    Steps made{{bench.problem_.positions}, {}};
    try {
      const auto objective = bench.on(device);
      NewtonRules rules;
      rules.most_products = 20;
      NewtonMethod method(*objective, rules);
      for (int step = 0; step < count; ++step) {
        method.step();
        made.positions.push_back(bench.problem_.positions);
      }
    } catch (const DeviceFailed& failed) {
      made.fault = failed.fault;
      EXPECT_EQ(bench.problem_.positions, made.positions.back()) << "the nodes are where the last step ended";
    }
    return made;
  }
};

TEST_F(DescentOnACard, HasTheProcessorsBits) {
  const auto here = card("");
  const auto cpu = device::make_cpu_device();
  EXPECT_EQ(steps(*here, 3).positions, steps(*cpu, 3).positions);
  const auto checked = check_descent(*here);
  EXPECT_TRUE(checked) << checked.error().sentence;
}

TEST_F(DescentOnACard, IsFoundOutIfItComputesOtherNumbers) {
  const auto checked = check_descent(*card("wrong"));
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().kind, device::Fault::Kind::BadKernels);
}

TEST_F(DescentOnACard, FailsWithASentenceWhereverItFails) {
  const auto expected = steps(*device::make_cpu_device(), 3).positions;
  using Kind = device::Fault::Kind;
  const std::pair<const char*, Kind> faults[] = {{"memory=20000", Kind::OutOfMemory},
                                                 {"memory=600000", Kind::OutOfMemory},
                                                 {"load=218", Kind::BadKernels},
                                                 {"load=222", Kind::OldDriver},
                                                 {"launch=701", Kind::BadKernels}};
  for (const auto& [state, kind] : faults) {
    SCOPED_TRACE(state);
    const Steps made = steps(*card(state), 3);
    ASSERT_TRUE(made.fault);
    EXPECT_EQ(made.fault->kind, kind);
    EXPECT_EQ(made.fault->sentence.back(), '.');
    EXPECT_EQ(made.positions.size(), 1U);
  }
  std::size_t most = 0, lost = 0;
  for (int launch = 1; launch < 4000; launch = launch * 5 / 4 + 1)
    for (const char* how : {"lost=", "lost_at_wait="}) {
      SCOPED_TRACE(how + std::to_string(launch));
      const Steps made = steps(*card(how + std::to_string(launch)), 3);
      if (!made.fault) continue;
      ++lost;
      EXPECT_EQ(made.fault->kind, Kind::Lost);
      for (std::size_t step = 0; step < made.positions.size(); ++step) EXPECT_EQ(made.positions[step], expected[step]);
      most = std::max(most, made.positions.size());
    }
  EXPECT_GT(lost, 10U);
  EXPECT_GT(most, 1U) << "the card was lost after a step, too";
}

}  // namespace
}  // namespace varimesh
