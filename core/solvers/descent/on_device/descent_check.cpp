#include "core/solvers/descent/on_device/descent_check.h"

#include <vector>

#include "core/base/index.h"
#include "core/device/cpu_device.h"
#include "core/device_kernels/self_check.h"
#include "core/kernels/p_norm.h"
#include "core/mesh/connectivity.h"
#include "core/problem/node_conversion.h"
#include "core/quality/accuracy/team_accuracy.h"
#include "core/solvers/descent/on_device/device_loss.h"
#include "core/solvers/newton_method.h"

namespace varimesh {
namespace {

/// The kernels of the descent do not depend on the order, and check_kernels() has compared those of the cells.
constexpr int kHighestOrder = 3;
/// Of the energy, the stiffness of the levels and what holds nodes: like squared losses of bent cells.
constexpr double kWeight = 1e-3;

/// What two steps return, then what the functions do that steps need now and then; the positions at the end.
std::vector<double> numbers_of(DeviceLoss& objective, const Problem& problem) {
  std::vector<double> numbers;
  NewtonRules rules;
  rules.most_products = 20;
  NewtonMethod method(objective, rules);
  for (int step = 0; step < 2; ++step) {
    const NewtonOutcome outcome = method.step();
    numbers.insert(numbers.end(), {outcome.before, outcome.after, outcome.residual, outcome.gradient_norm});
  }
  numbers.push_back(objective.linearise(true));
  objective.make_convex();
  numbers.push_back(objective.precondition());
  objective.turn(0);
  numbers.push_back(objective.multiply());
  objective.take_direction();
  numbers.push_back(objective.largest_step());
  numbers.push_back(objective.finish_step());
  numbers.push_back(objective.move(0.5));
  objective.settle();
  numbers.push_back(objective.largest_defect());
  numbers.insert(numbers.end(), problem.positions.begin(), problem.positions.end());
  return numbers;
}

device::Possible<std::vector<double>> results(device::Device& device, Problem problem, double wave) {
  const Material material = varimesh::material(Options{});
  const auto kernels = make_kernels(material, problem.dimension);
  const auto hessian = make_hessian_kernels(material, problem.dimension);
  const Team team(1);
  const std::vector<double> weights(at(problem.cells), kWeight), hold(problem.free.size(), kWeight);
  const std::vector<double> places = free_positions(problem, problem.positions, team);
  CellEnergy energy(problem, *kernels, *hessian, PNorm{}, team);
  energy.weigh(weights, problem.cells);
  const OrderSpace space = own_space(problem, team);
  ModalForm form(problem, space, wave, team);
  OrderLevels levels(problem, space, team);
  levels.take_diagonals(form, weights);
  try {
    DeviceLoss objective(device, problem, energy, form, levels, material, team);
    objective.begin_round(hold, places);
    return numbers_of(objective, problem);
  } catch (const DeviceFailed& failed) {
    return tl::unexpected(failed.fault);
  }
}

}  // namespace

device::Possible<void> check_descent(device::Device& device) {
  const auto cpu = device::make_cpu_device();
  for (const HighOrderMesh& mesh : device::check_meshes()) {
    if (mesh.order > kHighestOrder) continue;
    Problem problem = build_problem(mesh, fixed_nodes(mesh), 0);
    problem.positions = solver_positions(mesh, frame_of(mesh));
    set_straight_sided_targets(problem);
    for (CellSet& set : problem.sets) set.delta_squared.assign(at(set.count), 0.0);
    const double wave = local_wave(mesh);
    const auto ours = results(device, problem, wave), theirs = results(*cpu, problem, wave);
    if (!ours) return tl::unexpected(ours.error());
    if (!theirs) return tl::unexpected(theirs.error());
    if (!device::same_numbers(*ours, *theirs)) return device::other_numbers(device, mesh);
  }
  return {};
}

}  // namespace varimesh
