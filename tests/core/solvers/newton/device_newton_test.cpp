// Newton's method on a device: operation by operation and step by step what it is on the processor. The device is the
// processor in a device's place.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <string>

#include "core/device/cpu_device.h"
#include "core/solvers/checkpoint.h"
#include "core/solvers/newton/newton.h"
#include "tests/core/solvers/newton/newton_cases.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::Place;

using Case = NewtonCase;
using Prepared = PreparedNewton;

constexpr Case kCases[] = {{"Tetrahedra3", Filling::Tetrahedra, 3, 0.03},
                           {"Tetrahedra4", Filling::Tetrahedra, 4, 0.02},
                           {"Tetrahedra6", Filling::Tetrahedra, 6, 0.02},
                           {"Triangles4", Filling::Triangles, 4, 0.1},
                           {"Quadrilaterals3", Filling::Quadrilaterals, 3, 0.1},
                           {"Hexahedra3", Filling::Hexahedra, 3, 0.03},
                           {"Prisms3", Filling::Prisms, 3, 0.03},
                           {"Pyramids2", Filling::Pyramids, 2, 0.1},
                           {"MixedPlane3", Filling::MixedPlane, 3, 0.1},
                           {"MixedSolid2", Filling::MixedSolid, 2, 0.1},
                           {"PNorm3", Filling::Tetrahedra, 3, 0.03, 3},
                           {"PNorm3Plane", Filling::Triangles, 4, 0.1, 3},
                           {"Distortion", Filling::Tetrahedra, 3, 0.03, 1, Energy::Distortion},
                           {"LinearElastic", Filling::Triangles, 3, 0.1, 1, Energy::LinearElastic}};

/// δ² is not 0 in these.
constexpr Case kTangled[] = {{"Tangled", Filling::Tetrahedra, 3, 0.8}, {"TangledPlane", Filling::Triangles, 3, 0.8}};

/// A run's energy is not convex where it begins in these: conjugate gradients end in directions without positive
/// curvature. Which direction is the first of them depends on the rounding of products, and what follows on that.
constexpr Case kIndefinite[] = {{"Hexahedra3", Filling::Hexahedra, 3, 0.1}, {"Prisms3", Filling::Prisms, 3, 0.1}};
class DeviceNewtonOnIndefinite : public ::testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Cases, DeviceNewtonOnIndefinite, ::testing::ValuesIn(kIndefinite),
                         [](const auto& info) { return std::string(info.param.name); });

class DeviceNewton : public ::testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Cases, DeviceNewton, ::testing::ValuesIn(kCases),
                         [](const auto& info) { return std::string(info.param.name); });
class DeviceNewtonOnTangled : public ::testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Cases, DeviceNewtonOnTangled, ::testing::ValuesIn(kTangled),
                         [](const auto& info) { return std::string(info.param.name); });

/// Close in relation to the expected number.
void expect_close(double ours, double theirs, double relative, const char* what) {
  EXPECT_NEAR(ours, theirs, relative * std::abs(theirs)) << what;
}

/// Does what NewtonMethod does to whole vectors in a step, and compares every number.
void compare_operations(Minimised& ours, Minimised& theirs, int products) {
  const double energy = theirs.linearise(true);
  EXPECT_NEAR(ours.linearise(true), energy, 1e-13 * (std::abs(energy) + 1)) << "energy";
  expect_close(ours.gradient_norm(), theirs.gradient_norm(), 1e-12, "gradient");
  double rz = theirs.precondition();
  const double initial = rz;
  expect_close(ours.precondition(), rz, 1e-3, "preconditioner");
  expect_close(ours.preconditioned_norm(rz), theirs.preconditioned_norm(rz), 1e-12, "its norm");
  expect_close(ours.largest_correction(), theirs.largest_correction(), 1e-2, "correction");
  ours.turn(0);
  theirs.turn(0);
  for (int product = 0; product < products; ++product) {
    const double curvature = theirs.multiply();
    expect_close(ours.multiply(), curvature, 1e-3, "curvature");
    if (!(curvature > 0)) {
      ours.take_direction();
      theirs.take_direction();
      break;
    }
    ours.advance(rz / curvature);
    theirs.advance(rz / curvature);
    const double next = theirs.precondition();
    EXPECT_NEAR(ours.precondition(), next, 1e-3 * initial);
    ours.turn(next / rz);
    theirs.turn(next / rz);
    rz = next;
  }
  expect_close(ours.largest_step(), theirs.largest_step(), 1e-2, "step");
  const double slope = theirs.finish_step();
  expect_close(ours.finish_step(), slope, 1e-3, "slope");
  expect_close(ours.noise(), theirs.noise(), 1e-12, "noise");
  for (const double alpha : {0.25, 0.0}) {
    const double there = theirs.move(alpha), here = ours.move(alpha);
    if (std::isfinite(there)) {
      EXPECT_NEAR(here, there, 1e-3 * std::abs(there - energy) + 1e-12 * std::abs(energy)) << "energy after the step";
    }
  }
}

void compare_operations_on(const Case& one) {
  const HighOrderMesh mesh = mesh_of(one);
  Prepared here(mesh, options_of(one)), there(mesh, options_of(one));
  const auto device = device::make_cpu_device();
  here.team_.run([&] {
    DeviceObjective ours(*device, here.problem_, *here.kernels_, *here.hessian_, here.material_, here.norm_,
                         here.team_);
    MeshObjective theirs(there.problem_, *there.kernels_, *there.hessian_, there.norm_, there.team_);
    compare_operations(ours, theirs, 3);
    EXPECT_EQ(here.problem_.positions, there.problem_.positions) << "nothing was settled";
    EXPECT_GT(ours.memory(), 0U);
  });
}
TEST_P(DeviceNewton, DoesToVectorsWhatTheProcessorDoes) { compare_operations_on(GetParam()); }
TEST_P(DeviceNewtonOnTangled, DoesToVectorsWhatTheProcessorDoes) { compare_operations_on(GetParam()); }

/// What a run of steps until convergence has done.
struct Ran {
  int steps = 0, products = 0;
  bool converged = false;
  double energy = 0;
  std::int64_t invalid = 0;
};
Ran run(Prepared& prepared, Newton& newton, int most_steps = 40) {
  Ran ran;
  while (ran.steps < most_steps && !ran.converged) {
    const NewtonOutcome outcome = prepared.step(newton);
    ++ran.steps;
    ran.products += outcome.products;
    ran.converged = outcome.converged;
    ran.energy = outcome.after;
  }
  ran.invalid = prepared.seen_.invalid;
  return ran;
}

/// What the processor and a device did from the same start.
struct BothRan {
  Ran here, there;
};
BothRan run_both(const Case& one) {
  const HighOrderMesh mesh = mesh_of(one);
  Prepared here(mesh, options_of(one)), there(mesh, options_of(one));
  device::RunDevice device(device::make_cpu_device());
  std::optional<Newton> ours, theirs;
  here.begin(ours, device);
  there.begin(theirs);
  const BothRan both{run(here, *ours), run(there, *theirs)};
  EXPECT_FALSE(device.done_on().empty());
  EXPECT_FALSE(device.fault()) << device.fault()->sentence;
  EXPECT_EQ(both.here.converged, both.there.converged);
  EXPECT_EQ(both.here.invalid, both.there.invalid);
  EXPECT_NEAR(both.here.energy, both.there.energy, 1e-6 * std::abs(both.there.energy));
  return both;
}

TEST_P(DeviceNewton, EndsWhereTheProcessorEnds) {
  const auto [ours, theirs] = run_both(GetParam());
  EXPECT_NEAR(ours.steps, theirs.steps, 1);
  EXPECT_NEAR(ours.products, theirs.products, std::max(3.0, 0.05 * theirs.products));
}
TEST_P(DeviceNewtonOnIndefinite, EndsWhereTheProcessorEnds) { EXPECT_TRUE(run_both(GetParam()).there.converged); }

TEST_P(DeviceNewton, GivesTheSameBitsInEveryRun) {
  const HighOrderMesh mesh = mesh_of(GetParam());
  std::vector<double> first;
  for (const int threads : {1, 2}) {
    Prepared prepared(mesh, options_of(GetParam()));
    prepared.team_.set_threads(threads);
    device::RunDevice device(device::make_cpu_device());
    std::optional<Newton> newton;
    prepared.begin(newton, device);
    for (int step = 0; step < 3; ++step) prepared.step(*newton);
    if (threads == 1) first = prepared.problem_.positions;
    EXPECT_EQ(prepared.problem_.positions, first);
  }
}

/// What a step leaves for the next, as a checkpoint has it.
std::string kept(Newton& newton) {
  std::string bytes;
  CheckpointWriter writer(
      [&](std::string_view more) {
        bytes += more;
        return true;
      },
      1);
  newton.state(writer);
  writer.finish();
  return bytes;
}
void read(Newton& newton, const std::string& bytes) {
  CheckpointReader reader(bytes, 1);
  newton.state(reader);
  EXPECT_FALSE(reader.failed());
}

// Each step of the processor's run, made on a device from the same state.
TEST_P(DeviceNewtonOnIndefinite, MakesTheProcessorsStepsFromWhereTheyBegin) {
  const HighOrderMesh mesh = mesh_of(GetParam());
  Prepared there(mesh, {});
  std::optional<Newton> theirs;
  there.begin(theirs);
  device::RunDevice device(device::make_cpu_device());
  int indefinite = 0;
  for (int step = 0; step < 8; ++step) {
    Prepared here(mesh, {});
    here.put(there.problem_.positions);
    std::optional<Newton> ours;
    here.begin(ours, device);
    read(*ours, kept(*theirs));
    const NewtonOutcome our_step = here.step(*ours), their_step = there.step(*theirs);
    SCOPED_TRACE(step);
    expect_close(our_step.before, their_step.before, 1e-12, "energy");
    expect_close(our_step.gradient_norm, their_step.gradient_norm, 1e-11, "gradient");
    expect_close(our_step.residual, their_step.residual, 0.01, "residual");
    EXPECT_EQ(our_step.damping, their_step.damping);
    EXPECT_EQ(our_step.linear_solve, their_step.linear_solve);
    EXPECT_NEAR(our_step.products, their_step.products, 1);
    EXPECT_NEAR(our_step.after, their_step.after, 0.01 * (their_step.before - their_step.after));
    if (their_step.linear_solve == LinearSolve::NegativeCurvature) ++indefinite;
  }
  EXPECT_GT(indefinite, 2);
}

// A step leaves the same for the next wherever it was made, so a checkpoint can be read elsewhere.
TEST_P(DeviceNewton, LeavesAStateThatTheProcessorReads) {
  const HighOrderMesh mesh = mesh_of(GetParam());
  Prepared prepared(mesh, options_of(GetParam()));
  device::RunDevice device(device::make_cpu_device());
  std::optional<Newton> newton;
  prepared.begin(newton, device);
  for (int step = 0; step < 2; ++step) prepared.step(*newton);
  const std::string state = kept(*newton);
  const std::vector<double> positions = prepared.problem_.positions;
  prepared.step(*newton);
  const std::vector<double> expected = prepared.problem_.positions;
  prepared.problem_.positions = positions;
  prepared.begin(newton, device);
  read(*newton, state);
  EXPECT_EQ(kept(*newton), state);
  prepared.step(*newton);
  EXPECT_EQ(prepared.problem_.positions, expected) << "the step on the device is the same after the state was read";
  prepared.problem_.positions = positions;
  prepared.begin(newton);
  read(*newton, state);
  prepared.step(*newton);
  double largest = 0;
  for (std::size_t i = 0; i < expected.size(); ++i)
    largest = std::max(largest, std::abs(expected[i] - prepared.problem_.positions[i]));
  EXPECT_LT(largest, 1e-4) << "and nearly the same on the processor";
}

/// In one of eleven of the 125 cubes, the centre is close to a side.
Place with_flat_cells(Place at) {
  const auto cube = [](double x) { return int(std::floor(5 * x)); };
  const auto is_centre = [](double x) { return std::abs(5 * x - std::floor(5 * x) - 0.5) < 1e-6; };
  if (!is_centre(at[0]) || !is_centre(at[1]) || !is_centre(at[2])) return at;
  if ((cube(at[0]) + 2 * cube(at[1]) + 3 * cube(at[2])) % 11 == 0) at[0] -= 0.097;
  return at;
}

TEST(DeviceNewtonOnStretchedCells, HasTheirFactors) {
  const HighOrderMesh mesh = testing::grid(Filling::Pyramids, {5, 5, 5}, 2, with_flat_cells);
  Prepared here(mesh, {}), there(mesh, {});
  HighOrderMesh bent = mesh;
  testing::shake(bent, 2e-5, 5);
  here.problem_.positions = there.problem_.positions = solver_positions(bent, frame_of(bent));
  const auto device = device::make_cpu_device();
  here.team_.run([&] {
    DeviceObjective ours(*device, here.problem_, *here.kernels_, *here.hessian_, here.material_, here.norm_,
                         here.team_);
    MeshObjective theirs(there.problem_, *there.kernels_, *there.hessian_, there.norm_, there.team_);
    compare_operations(ours, theirs, 2);
    const std::vector<BatchSet> batches = make_batches(here.problem_, *here.hessian_);
    StretchedCells cells(here.problem_, batches, StretchedCells::most_cells(here.problem_), here.team_);
    cells.assemble(theirs.preconditioner().coarse().tensors());
    EXPECT_GT(cells.groups().size(), 0U) << "there is something to compare";
  });
}

}  // namespace
}  // namespace varimesh
