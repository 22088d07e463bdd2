// The modal form and the preconditioner of the descent on a device, number by number as on the processor. The device is
// the processor in a device's place.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/device/cpu_device.h"
#include "core/device_kernels/cell_modules.h"
#include "tests/core/solvers/descent/on_device/descent_cases.h"

namespace varimesh {
namespace {

using testing::Filling;

std::vector<DescentCase> cases() {
  std::vector<DescentCase> cases;
  for (const Filling filling : testing::kFillings)
    for (const int order : {2, 3, 4}) cases.push_back({filling, order});
  cases.push_back({Filling::Triangles, 7});
  cases.push_back({Filling::Hexahedra, 5});
  return cases;
}

class FormOnADevice : public ::testing::TestWithParam<DescentCase> {
 protected:
  FormOnADevice()
      : bench_(GetParam()),
        device_(device::make_cpu_device()),
        queue_(*device_),
        module_(queue_.load(device::descent_kernels(dimension()))),
        cells_(std::move(*device::CellsOnDevice::make(*device_, bench_.problem_, bench_.material_))),
        joiner_(queue_, module_.get()),
        values_(queue_, module_.get(), cells_->contributions().bytes() / sizeof(double)),
        levels_(queue_, module_.get(), bench_.problem_, bench_.levels_, values_, contributions(), joiner_, Team(1)),
        form_(queue_, module_.get(), *cells_, bench_.problem_, bench_.form_, levels_.own(), values_, joiner_) {
    form_.take_frames();
    levels_.take_diagonals();
  }

  int dimension() const { return bench_.problem_.dimension; }
  double* contributions() const { return cells_->contributions().as<double>(); }
  device::Buffer copy(const std::vector<double>& numbers) {
    device::Buffer buffer;
    queue_.fill(buffer, numbers);
    return buffer;
  }
  std::vector<double> copy(const device::Buffer& buffer) {
    std::vector<double> numbers(buffer.bytes() / sizeof(double));
    queue_.download(buffer, std::span<double>(numbers));
    EXPECT_TRUE(queue_.is_well());
    return numbers;
  }
  /// The contributions added up at the free nodes.
  std::vector<double> added_up() {
    const device::Buffer sums = queue_.room(bench_.from_.size() * sizeof(double));
    device::OrderArguments a = levels_.own().arguments(contributions());
    a.residual = sums.as<double>();
    queue_.launch(queue_.kernel(module_.get(), "add_up_residual"), a.nodes, a);
    return copy(sums);
  }
  static void expect_close(const std::vector<double>& ours, const std::vector<double>& theirs, double relative) {
    double size = 0, largest = 0;
    ASSERT_EQ(ours.size(), theirs.size());
    for (std::size_t i = 0; i < ours.size(); ++i) {
      size = std::max(size, std::abs(theirs[i]));
      largest = std::max(largest, std::abs(ours[i] - theirs[i]));
    }
    EXPECT_GT(size, 0);
    EXPECT_LE(largest, relative * size);
  }

  PreparedDescent bench_;
  std::unique_ptr<device::Device> device_;
  device::Queue queue_;
  std::unique_ptr<device::Module> module_;
  std::unique_ptr<device::CellsOnDevice> cells_;
  device::Joiner joiner_;
  CellValues values_;
  LevelsOnDevice levels_;
  FormOnDevice form_;
};
INSTANTIATE_TEST_SUITE_P(Cases, FormOnADevice, ::testing::ValuesIn(cases()),
                         [](const auto& info) { return name_of(info.param); });

TEST_P(FormOnADevice, HasItsValueAndGradient) {
  std::vector<double> gradient(bench_.from_.size());
  const double value = bench_.form_.gradient(gradient);
  EXPECT_GT(value, 0);
  EXPECT_NEAR(form_.gradient(), value, 1e-12 * value);
  expect_close(added_up(), gradient, 1e-12);
}

TEST_P(FormOnADevice, HasItsProducts) {
  const std::vector<double> direction = testing::random_direction(bench_.problem_, 7);
  std::vector<double> product(direction.size());
  bench_.form_.multiply(direction, product);
  const device::Buffer there = copy(direction);
  form_.multiply(there.as<const double>());
  expect_close(added_up(), product, 1e-12);
}

TEST_P(FormOnADevice, FollowsTheFrames) {
  std::vector<double> gradient(bench_.from_.size());
  const double before = form_.gradient();
  bench_.team_.run([&] { bench_.form_.take_frames(); });
  form_.take_frames();
  const double value = bench_.form_.gradient(gradient);
  EXPECT_NE(value, before);
  EXPECT_NEAR(form_.gradient(), value, 1e-12 * value);
}

TEST_P(FormOnADevice, HasThePreconditioner) {
  std::vector<double> residual = testing::random_direction(bench_.problem_, 8);
  std::vector<double> solution(residual.size());
  const double along = bench_.levels_.apply(residual, solution);
  const device::Buffer r = copy(residual), z = queue_.room(r.bytes());
  EXPECT_NEAR(levels_.apply(r.as<double>(), z.as<double>()), along, 1e-12 * along);
  expect_close(copy(z), solution, 1e-12);
  EXPECT_EQ(copy(r), residual);
}

}  // namespace
}  // namespace varimesh
