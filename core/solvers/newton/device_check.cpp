#include "core/solvers/newton/device_check.h"

#include <vector>

#include "core/device/cpu_device.h"
#include "core/device_kernels/self_check.h"
#include "core/mesh/connectivity.h"
#include "core/problem/node_conversion.h"
#include "core/solvers/newton/device_objective.h"
#include "core/solvers/newton_method.h"

namespace varimesh {
namespace {

/// Newton's own kernels do not depend on the order, and check_kernels() has compared those of the cells.
constexpr int kHighestOrder = 3;

/// The positions after two steps.
device::Possible<std::vector<double>> positions(device::Device& device, Problem problem, double p_norm) {
  const Material material = varimesh::material(Options{});
  const auto kernels = make_kernels(material, problem.dimension);
  const auto hessian = make_hessian_kernels(material, problem.dimension);
  const Team team(1);
  try {
    DeviceObjective objective(device, problem, *kernels, *hessian, material, PNorm{p_norm}, team);
    NewtonRules rules;
    rules.most_products = 20;
    rules.tolerance = 1e-6;
    NewtonMethod method(objective, rules);
    for (int step = 0; step < 2; ++step) method.step();
  } catch (const DeviceFailed& failed) {
    return tl::unexpected(failed.fault);
  }
  return std::move(problem.positions);
}

}  // namespace

device::Possible<void> check_newton(device::Device& device) {
  const auto cpu = device::make_cpu_device();
  for (const HighOrderMesh& mesh : device::check_meshes())
    for (const double p_norm : {1.0, 2.0}) {
      if (mesh.order > kHighestOrder) continue;
      Problem problem = build_problem(mesh, fixed_nodes(mesh), 0);
      problem.positions = solver_positions(mesh, frame_of(mesh));
      set_straight_sided_targets(problem);
      for (CellSet& set : problem.sets) set.delta_squared.assign(static_cast<std::size_t>(set.count), 0.01);
      const auto ours = positions(device, problem, p_norm), theirs = positions(*cpu, problem, p_norm);
      if (!ours) return tl::unexpected(ours.error());
      if (!theirs) return tl::unexpected(theirs.error());
      if (!device::same_numbers(*ours, *theirs)) return device::other_numbers(device, mesh);
    }
  return {};
}

}  // namespace varimesh
