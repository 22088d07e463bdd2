// What the descent minimises, on a device: operation by operation and step by step what it is on the processor. The
// device is the processor in a device's place.
#include "core/solvers/descent/on_device/device_loss.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/device/cpu_device.h"
#include "core/solvers/descent/on_device/descent_check.h"
#include "core/solvers/newton_method.h"
#include "tests/core/solvers/descent/on_device/descent_cases.h"

namespace varimesh {
namespace {

using testing::Filling;

constexpr DescentCase kCases[] = {{Filling::Triangles, 2},
                                  {Filling::Triangles, 4},
                                  {Filling::Triangles, 6},
                                  {Filling::Quadrilaterals, 3},
                                  {Filling::MixedPlane, 3},
                                  {Filling::Tetrahedra, 2},
                                  {Filling::Tetrahedra, 3},
                                  {Filling::Tetrahedra, 4},
                                  {Filling::Hexahedra, 2},
                                  {Filling::Hexahedra, 3},
                                  {Filling::Prisms, 3},
                                  {Filling::Pyramids, 2},
                                  {Filling::MixedSolid, 3},
                                  {Filling::Tetrahedra, 3, 0.02, Energy::Distortion},
                                  {Filling::Triangles, 3, 0.02, Energy::LinearElastic}};

class DeviceLossOf : public ::testing::TestWithParam<DescentCase> {};
INSTANTIATE_TEST_SUITE_P(Cases, DeviceLossOf, ::testing::ValuesIn(kCases),
                         [](const auto& info) { return name_of(info.param); });

/// Close in relation to the expected number.
void expect_close(double ours, double theirs, double relative, const char* what) {
  EXPECT_NEAR(ours, theirs, relative * std::abs(theirs)) << what;
}

/// Both solve the linear system with a few products.
void solve(Minimised& ours, Minimised& theirs, int products) {
  double rz = theirs.precondition();
  expect_close(ours.precondition(), rz, 1e-11, "preconditioner");
  expect_close(ours.preconditioned_norm(rz), theirs.preconditioned_norm(rz), 1e-15, "its norm");
  expect_close(ours.largest_correction(), theirs.largest_correction(), 1e-11, "correction");
  ours.turn(0);
  theirs.turn(0);
  for (int product = 0; product < products; ++product) {
    const double curvature = theirs.multiply();
    expect_close(ours.multiply(), curvature, 1e-5, "curvature");
    if (!(curvature > 0)) {
      ours.take_direction();
      theirs.take_direction();
      return;
    }
    ours.advance(rz / curvature);
    theirs.advance(rz / curvature);
    const double next = theirs.precondition();
    expect_close(ours.precondition(), next, 1e-4, "preconditioner of what is left");
    ours.turn(next / rz);
    theirs.turn(next / rz);
    rz = next;
  }
}

void compare_operations(Minimised& ours, Minimised& theirs) {
  const double value = theirs.linearise(true);
  expect_close(ours.linearise(true), value, 1e-12, "objective");
  expect_close(ours.gradient_norm(), theirs.gradient_norm(), 1e-11, "gradient");
  expect_close(ours.noise(), theirs.noise(), 1e-12, "noise");
  solve(ours, theirs, 3);
  expect_close(ours.largest_step(), theirs.largest_step(), 1e-5, "step");
  const bool is_made_convex = theirs.make_convex();
  EXPECT_EQ(ours.make_convex(), is_made_convex);
  EXPECT_FALSE(ours.make_convex()) << "it is convex already, or cannot be made so";
  if (is_made_convex) solve(ours, theirs, 3);
  const double slope = theirs.finish_step();
  expect_close(ours.finish_step(), slope, 1e-5, "slope");
  for (const double alpha : {0.25, 0.0, 0.5}) {
    const double there = theirs.move(alpha), here = ours.move(alpha);
    if (std::isfinite(there)) {
      EXPECT_NEAR(here, there, 1e-5 * std::abs(there - value) + 1e-12 * value) << "objective after the step";
    } else {
      EXPECT_EQ(here, there);
    }
  }
  ours.settle();
  theirs.settle();
  expect_close(ours.largest_defect(), theirs.largest_defect(), 1e-3, "defect");
}

TEST_P(DeviceLossOf, DoesToVectorsWhatTheProcessorDoes) {
  PreparedDescent here(GetParam()), there(GetParam());
  const auto device = device::make_cpu_device();
  here.team_.run([&] {
    const std::vector<double> positions = here.problem_.positions;
    const auto ours = here.on(*device);
    compare_operations(*ours, there.processor_);
    EXPECT_NE(here.problem_.positions, positions) << "the step was settled";
    for (std::size_t cell = 0; cell < at(here.problem_.cells); ++cell)
      EXPECT_NEAR(here.energy_.scans()[cell].energy, there.energy_.scans()[cell].energy,
                  1e-6 * there.energy_.scans()[cell].energy);
    EXPECT_GT(ours->memory(), 0U);
  });
}

NewtonRules rules() {
  NewtonRules rules;
  rules.most_products = 100;
  rules.few_products = 3;
  rules.convex_below = 0.25;
  return rules;
}

TEST_P(DeviceLossOf, MakesTheProcessorsSteps) {
  PreparedDescent here(GetParam()), there(GetParam());
  const auto device = device::make_cpu_device();
  here.team_.run([&] {
    const auto on_device = here.on(*device);
    NewtonMethod ours(*on_device, rules()), theirs(there.processor_, rules());
    double before = 0;
    for (int step = 0; step < 2; ++step) {
      SCOPED_TRACE(step);
      const NewtonOutcome our_step = ours.step(), their_step = theirs.step();
      if (step == 0) before = their_step.before;
      EXPECT_EQ(our_step.damping, their_step.damping);
      EXPECT_NEAR(our_step.products, their_step.products, 1);
      EXPECT_LT(their_step.after, before);
      EXPECT_NEAR(our_step.after, their_step.after, 1e-5 * before);
    }
    double largest = 0;
    for (std::size_t i = 0; i < here.problem_.positions.size(); ++i)
      largest = std::max(largest, std::abs(here.problem_.positions[i] - there.problem_.positions[i]));
    EXPECT_LT(largest, 1e-4);
  });
}

TEST_P(DeviceLossOf, GivesTheSameBitsInEveryRun) {
  std::vector<double> first;
  for (const int threads : {1, 2}) {
    PreparedDescent here(GetParam(), threads);
    const auto device = device::make_cpu_device();
    here.team_.run([&] {
      const auto on_device = here.on(*device);
      NewtonMethod method(*on_device, rules());
      for (int step = 0; step < 2; ++step) method.step();
    });
    if (threads == 1) first = here.problem_.positions;
    EXPECT_EQ(here.problem_.positions, first);
  }
}

TEST(DeviceLossConvexPart, IsThatOfTheProcessor) {
  for (const DescentCase one : {DescentCase{Filling::Tetrahedra, 3, 0.05}, DescentCase{Filling::Hexahedra, 2, 0.2},
                                DescentCase{Filling::Triangles, 4, 0.1}, DescentCase{Filling::Pyramids, 2, 0.1}}) {
    SCOPED_TRACE(name_of(one));
    PreparedDescent here(one), there(one);
    const auto device = device::make_cpu_device();
    here.team_.run([&] {
      const auto ours = here.on(*device);
      ours->linearise(true);
      EXPECT_TRUE(std::isfinite(there.processor_.linearise(true)));
      const auto curvature = [](Minimised& objective) {
        objective.precondition();
        objective.turn(0);
        return objective.multiply();
      };
      const double before = curvature(there.processor_);
      expect_close(curvature(*ours), before, 1e-5, "curvature");
      ASSERT_TRUE(ours->make_convex());
      ASSERT_TRUE(there.processor_.make_convex());
      EXPECT_GT(std::abs(curvature(there.processor_) - before), 1e-4 * before) << "there is something to compare";
      expect_close(curvature(*ours), curvature(there.processor_), 1e-5, "curvature of the convex part");
    });
  }
}

TEST(DescentCheck, FindsNothingWrongWithTheProcessorInADevicesPlace) {
  const auto device = device::make_cpu_device();
  const auto checked = check_descent(*device);
  EXPECT_TRUE(checked) << checked.error().sentence;
}

}  // namespace
}  // namespace varimesh
