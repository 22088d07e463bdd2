#include "core/optimise/memory.h"

#include <algorithm>

#include "core/energy/material.h"
#include "core/kernels/hessian/batches.h"
#include "core/kernels/kernels.h"
#include "core/mesh/mesh_counts.h"
#include "core/problem/problem_memory.h"
#include "core/quality/quality_memory.h"
#include "core/solvers/descent/descent_memory.h"
#include "core/solvers/guard/guard_memory.h"
#include "core/solvers/newton/newton_memory.h"
#include "core/solvers/sweeps/sweep_memory.h"
#include "core/validity/certificate.h"
#include "core/validity/validity_memory.h"

namespace varimesh {
namespace {

/// Rounding of small blocks, histories and whatever else does not grow with the mesh.
constexpr std::int64_t kSmallThings = std::int64_t{1} << 20;

/// Arrays that grow have up to twice the room that they need, and the allocator rounds up.
constexpr double kMargin = 1.07;

/// It is not known in advance how many cells will be split. Coarse meshes have grown threefold.
constexpr std::int64_t kGrowthBySplits = 3;

/// What the phases of a run have in use, for one mesh and its options.
struct Run {
  const MeshCounts& counts;
  Options options;
  std::vector<SetSizes> sets;
  NewtonSizes newton;
  bool keeps_function = false;
  bool levels_targets = false;  ///< Later stages of Objective::Worst have left factors.
  bool keeps_best = false;

  Run(const MeshCounts& of_mesh, const Options& of_run)
      : counts(of_mesh), options(of_run), sets(set_sizes(of_mesh, of_run.quadrature_degree)) {
    options.objective = objective_of(of_run, of_mesh.order);
    const bool is_worst = options.objective == Objective::Worst;
    newton.hessian_entries = make_hessian_kernels(material(options), counts.dimension)->entries();
    newton.has_norm = options.p_norm > 1 || is_worst;
    newton.has_left_factor = options.target == Target::Size;
    keeps_function = make_kernels(material(options), counts.dimension)->keeps_function();
    keeps_best = options.until_js > 0 || is_worst || options.objective == Objective::Accuracy;
  }

  bool iterates() const { return options.max_iterations > 0; }

  /// From the end of the set-up to the end of the run: the mesh, what is fixed, the problem, the colouring, the proofs.
  std::int64_t always() const {
    const std::int64_t cells = counts.cell_count();
    std::int64_t bytes = bytes_of_mesh(counts) + counts.nodes() / 8;
    bytes += bytes_of_certifier(cells) + cells * std::int64_t{sizeof(Certificate)};
    bytes += bytes_of_jacobian_tables(counts) + bytes_of_certifying(counts) + bytes_of_lattice_tables(counts);
    if (iterates()) bytes += bytes_of_problem(counts, sets, newton.has_left_factor) + bytes_of_colouring(counts);
    return bytes + kSmallThings;
  }

  std::int64_t set_up() const {
    const std::int64_t mesh = bytes_of_mesh(counts) + counts.nodes() / 4;
    if (!iterates()) return mesh + bytes_of_check(counts);
    const std::int64_t problem = bytes_of_problem(counts, sets, newton.has_left_factor);
    return mesh + std::max({bytes_of_check(counts), problem + bytes_of_building(counts, sets),
                            problem + bytes_of_making_colouring(counts)});
  }

  std::int64_t quality() const {
    const std::int64_t mesh = iterates() ? 3 * std::int64_t{sizeof(double)} * counts.nodes() : bytes_of_mesh(counts);
    return always() + std::max(mesh + bytes_of_quality(counts), bytes_of_making_jacobian_tables(counts));
  }

  /// While it iterates, without what the methods keep.
  std::int64_t between_methods() const {
    std::int64_t bytes = always() + bytes_of_guard(counts) + bytes_of_sweeper(counts);
    return bytes + (keeps_best ? bytes_of_best_mesh(counts) : 0);
  }

  std::int64_t of_sweeps() const { return bytes_of_first_sweep(counts) + bytes_of_deformation(sets, keeps_function); }

  std::int64_t of_newton() const {
    std::int64_t bytes = bytes_of_newton(counts, sets, newton);
    if (options.objective == Objective::Worst)  // a copy of the mesh is judged at the end of a stage
      bytes += bytes_of_mesh(counts) + bytes_of_quality(counts);
    return std::max(bytes, bytes_of_newton_set_up(counts, sets, newton));
  }

  /// For the Hessians of untangling, beside the deformation gradients of sweeps.
  std::int64_t room_for_hessians() const {
    const std::int64_t freed = options.method == Method::Sweeps ? 0 : of_newton() - of_sweeps();
    return std::max(freed, (between_methods() + of_sweeps()) / 8);
  }

  std::int64_t iterating() const {
    std::int64_t methods = 0;
    if (options.method != Method::Newton) methods = of_sweeps();
    if (options.method != Method::Sweeps) methods = std::max(methods, of_newton());
    if (options.objective == Objective::Accuracy) methods = std::max(methods, bytes_of_descent(counts, sets, newton));
    return between_methods() + methods;
  }
};

}  // namespace

std::int64_t memory_needed(const HighOrderMesh& mesh, const Options& options) {
  const MeshCounts counts = count(mesh, options.order > 0 ? options.order : mesh.order);
  const Run run(counts, options);
  std::int64_t bytes = std::max(run.set_up(), run.quality());
  if (run.iterates()) bytes = std::max(bytes, run.iterating());
  if (options.order > 0 && options.order != mesh.order)  // both meshes are there while one is made from the other
    bytes = std::max(bytes, bytes_of_mesh(count(mesh, mesh.order)) + 3 * bytes_of_mesh(counts) / 2);
  if (splits(options.repair) && run.iterates()) bytes = kGrowthBySplits * bytes + 2 * bytes_of_mesh(counts);
  return static_cast<std::int64_t>(kMargin * static_cast<double>(bytes));
}

std::int64_t room_for_hessians(const HighOrderMesh& mesh, const Options& options) {
  const MeshCounts counts = count(mesh, mesh.order);
  return Run(counts, options).room_for_hessians();
}

}  // namespace varimesh
