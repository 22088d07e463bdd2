// How long the kernels of a device take: nanoseconds per cell for cells of orders 2 to 4, and tetrahedra of order 5,
// with the goals for tetrahedra of order 4, and milliseconds for a step of conjugate gradients on them, on the energy
// and in the descent.
//
//   core_device_bench [--cells N] [--processor]
//
// N is the approximate number of cells of each kind; 1,000,000 by default. --processor runs on the processor in place
// of a card, which tests the program. The exit status is 1 if a goal is missed or a device has a fault, and 77 if there
// is no card.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <optional>
#include <string>
#include <thread>

#include "core/device/card.h"
#include "core/device/cpu_device.h"
#include "core/device_kernels/cells_on_device.h"
#include "core/device_kernels/judge/judge_on_device.h"
#include "core/quality/accuracy/team_accuracy.h"
#include "core/quality/quality.h"
#include "core/solvers/descent/on_device/device_loss.h"
#include "core/solvers/newton/device_objective.h"
#include "core/validity/certifier.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

/// Nanoseconds per quartic tetrahedron at most, and milliseconds per step of conjugate gradients on a million of them.
constexpr double kEnergyGoal = 2.5, kGradientGoal = 5, kLineariseGoal = 8, kProductGoal = 2.5, kStepGoal = 6;

bool all_well = true;

void must(const device::Possible<void>& done) {
  if (done) return;
  std::printf("%s\n", done.error().sentence.c_str());
  std::exit(1);
}

/// Seconds of one call: the shortest of three rounds of calls.
double seconds_of(device::Device& device, int calls, const std::function<device::Possible<void>()>& call) {
  double shortest = 1e300;
  must(call());
  must(device.wait());
  for (int round = 0; round < 3; ++round) {
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < calls; ++i) must(call());
    must(device.wait());
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    shortest = std::min(shortest, took.count() / calls);
  }
  return shortest;
}

std::string with_goal(double figure, double goal) {
  char text[40];
  std::snprintf(text, sizeof text, "%9.2f%s", figure, goal > 0 && figure > goal ? " (too long)" : "");
  all_well = all_well && !(goal > 0 && figure > goal);
  return text;
}

HighOrderMesh make_mesh(Filling filling, int order, double cells) {
  constexpr double kPerCube[] = {1, 2, 1.5, 1, 2, 6, 12, 5};  // as Filling has them
  const bool is_plane = testing::is_plane(filling);
  const double cubes = cells / kPerCube[static_cast<int>(filling)];
  const int side = std::max(1, static_cast<int>(std::lround(is_plane ? std::sqrt(cubes) : std::cbrt(cubes))));
  return testing::grid(filling, {side, side, is_plane ? 1 : side}, order, testing::bent(is_plane ? 2 : 3));
}

Problem prepare(const HighOrderMesh& mesh) {
  Problem problem = testing::make_problem(mesh);
  for (CellSet& set : problem.sets) set.delta_squared.assign(static_cast<std::size_t>(set.count), 0);
  return problem;
}

void measure_cells(device::Device& device, Filling filling, int order, double wanted, int calls) {
  const Problem problem = prepare(make_mesh(filling, order, wanted));
  auto made = device::CellsOnDevice::make(device, problem, material(Options{}));
  if (!made) return must(tl::unexpected(made.error()));
  device::CellsOnDevice& cells = **made;
  const auto per_cell = [&](const std::function<device::Possible<void>()>& call) {
    return seconds_of(device, calls, call) * 1e9 / problem.cells;
  };
  const bool has_goals = filling == Filling::Tetrahedra && order == 4 && problem.cells > 500'000;
  const auto goal = [&](double figure) { return has_goals ? figure : 0; };
  const double energy = per_cell([&] {
    device::Possible<void> done;
    for (const auto& set : cells.sets())
      if (done) done = set->scan(cells.shared());
    return done;
  });
  const double gradient = per_cell([&] { return cells.run_gradient(false); });
  const double linearise = per_cell([&] { return cells.run_gradient(true); });
  const double product = per_cell([&] { return cells.run_product(); });
  std::printf("%-16s %d %9d %s %s %s %s %8.0f\n", testing::name(filling), order, problem.cells,
              with_goal(energy, goal(kEnergyGoal)).c_str(), with_goal(gradient, goal(kGradientGoal)).c_str(),
              with_goal(linearise, goal(kLineariseGoal)).c_str(), with_goal(product, goal(kProductGoal)).c_str(),
              static_cast<double>(cells.memory()) / problem.cells);
}

/// A step of conjugate gradients on an objective whose vectors are on a device.
double seconds_of_step(device::Device& device, Minimised& objective, int calls) {
  objective.linearise(true);
  objective.precondition();
  objective.turn(0);
  return seconds_of(device, calls, [&]() -> device::Possible<void> {
    objective.multiply();
    objective.advance(1e-3);
    objective.precondition();
    objective.turn(0.5);
    return {};
  });
}

/// A step on the energy, with the whole preconditioner.
void measure_step(device::Device& device, double wanted, int calls) {
  Problem problem = prepare(make_mesh(Filling::Tetrahedra, 4, wanted));
  const Material material = varimesh::material(Options{});
  const auto kernels = make_kernels(material, 3);
  const auto hessian = make_hessian_kernels(material, 3);
  const Team team(static_cast<int>(std::thread::hardware_concurrency()));
  try {
    DeviceObjective objective(device, problem, *kernels, *hessian, material, PNorm{1}, team);
    const double seconds = seconds_of_step(device, objective, calls);
    std::printf("step of conjugate gradients on %d tetrahedra of order 4: %s ms, %.0f bytes per cell\n", problem.cells,
                with_goal(seconds * 1e3, problem.cells > 500'000 ? kStepGoal * problem.cells / 1e6 : 0).c_str(),
                static_cast<double>(objective.memory()) / problem.cells);
  } catch (const DeviceFailed& failed) {
    must(tl::unexpected(failed.fault));
  }
}

/// A step of the descent.
void measure_descent(device::Device& device, double wanted, int calls) {
  const HighOrderMesh mesh = make_mesh(Filling::Tetrahedra, 4, wanted);
  Problem problem = prepare(mesh);
  const Material material = varimesh::material(Options{});
  const auto kernels = make_kernels(material, 3);
  const auto hessian = make_hessian_kernels(material, 3);
  const Team team(static_cast<int>(std::thread::hardware_concurrency()));
  const std::vector<double> weights(static_cast<std::size_t>(problem.cells), 1e-3), hold(problem.free.size(), 1e-3);
  const std::vector<double> places = free_positions(problem, problem.positions, team);
  CellEnergy energy(problem, *kernels, *hessian, PNorm{}, team);
  energy.weigh(weights, problem.cells);
  const OrderSpace space = own_space(problem, team);
  ModalForm form(problem, space, local_wave(mesh), team);
  OrderLevels levels(problem, space, team);
  levels.take_diagonals(form, weights);
  try {
    DeviceLoss objective(device, problem, energy, form, levels, material, team);
    objective.begin_round(hold, places);
    std::printf("step of the descent on %d tetrahedra of order 4: %.2f ms, %.0f bytes per cell\n", problem.cells,
                seconds_of_step(device, objective, calls) * 1e3,
                static_cast<double>(objective.memory()) / problem.cells);
  } catch (const DeviceFailed& failed) {
    must(tl::unexpected(failed.fault));
  }
}

/// The first look of certificates and the samples of the quality report, with all that is copied.
void measure_judgement(device::Device& device, double wanted) {
  const HighOrderMesh mesh = make_mesh(Filling::Tetrahedra, 4, wanted);
  const Team team(static_cast<int>(std::thread::hardware_concurrency()));
  JudgeOnDevice judge(device, 3);
  Certifier certifier(mesh, {}, team);
  certifier.measure_with(&judge);
  std::vector<Certificate> certificates(certifier.cells());
  std::vector<detail::Extremes> samples(certifier.cells());
  const auto nanoseconds = [&](const std::function<void()>& work) {
    return seconds_of(device, 1,
                      [&]() -> device::Possible<void> {
                        team.run(work);
                        if (judge.fault()) return tl::unexpected(*judge.fault());
                        return {};
                      }) *
           1e9 / static_cast<double>(certifier.cells());
  };
  const double certified = nanoseconds([&] { certifier.certify(mesh.coordinates, certificates, team); });
  const double sampled =
      nanoseconds([&] { judge.sample(mesh, mesh.coordinates, report_intervals(mesh.order), team, samples); });
  std::printf("tetrahedra of order 4: certificates %.0f ns, samples of the quality report %.0f ns per cell\n",
              certified, sampled);
}

int run(device::Device& device, double cells, int calls) {
  std::printf("%s\n%-16s %s %9s %9s %9s %9s %9s %8s\n", device.properties().name.c_str(), "cells", "P", "count",
              "energy", "gradient", "linearise", "product", "bytes");
  for (const Filling filling :
       {Filling::Tetrahedra, Filling::Triangles, Filling::Quadrilaterals, Filling::Prisms, Filling::Hexahedra})
    for (const int order : {2, 3, 4}) measure_cells(device, filling, order, cells, calls);
  measure_cells(device, Filling::Tetrahedra, 5, cells, calls);
  measure_step(device, cells, calls);
  measure_descent(device, cells, calls);
  measure_judgement(device, cells);
  return all_well ? 0 : 1;
}

}  // namespace
}  // namespace varimesh

int main(int argc, char** argv) {
  double cells = 1e6;
  bool on_processor = false;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--processor") == 0) on_processor = true;
    if (std::strcmp(argv[i], "--cells") == 0 && i + 1 < argc) cells = std::atof(argv[++i]);
  }
  if (on_processor) return varimesh::run(*varimesh::device::make_cpu_device(), cells, 1);
  const auto driver = varimesh::device::Driver::open();
  const auto card = driver ? driver->use() : tl::unexpected(driver.error());
  if (!card) {
    std::printf("%s\n", card.error().sentence.c_str());
    return 77;
  }
  return varimesh::run(**card, cells, 20);
}
