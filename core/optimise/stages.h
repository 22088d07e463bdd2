// The stages of a run: which energies are minimised, one after another.
#pragma once

#include <memory>
#include <vector>

#include "core/kernels/hessian/batches.h"
#include "core/kernels/kernels.h"
#include "core/options/options.h"

namespace varimesh {

/// One energy to minimise. A stage starts where the one before it ended.
struct Stage {
  Options options;  ///< Those of the run, but with the stage's constants and p-norm.
  std::unique_ptr<Kernels> kernels;
  std::unique_ptr<HessianKernels> hessian;  ///< Null if the method does not need it.
};

/// The stages of a run. The first is the energy of the options. With Objective::Worst more follow: their λ and κ grow
/// relative to μ, their p-norm gives the worst cells more weight, and their targets are leveled (targets.h). A large λ
/// holds J close to that of the target everywhere in a cell, so the least J comes close to the greatest. The limit is
/// the quadrature, which must see all of the cell (docs/objectives.md has the figures). With Objective::Accuracy the
/// only stage ends as soon as the mesh is valid (phases.h); the descent of core/solvers/descent follows.
std::vector<Stage> make_stages(const Options& options, int dimension);

}  // namespace varimesh
