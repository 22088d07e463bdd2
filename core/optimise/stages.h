// What is minimised, one after another.
#pragma once

#include <memory>
#include <vector>

#include "core/hessian/batches.h"
#include "core/kernels/kernels.h"
#include "core/options/options.h"

namespace varimesh {

/// One energy to be minimised, from where the stage before it ended.
struct Stage {
  Options options;  ///< Those asked for, but for the constants and the p-norm.
  std::unique_ptr<Kernels> kernels;
  std::unique_ptr<HessianKernels> hessian;  ///< Where the method needs it.
};

/// The stages of an optimisation: first the energy asked for. With Objective::Worst more follow, whose λ and κ are ever
/// greater against μ, whose p-norm weighs the worst cells more, and whose targets are leveled (targets.h). A large λ
/// holds J to that of the target, everywhere in a cell, so that its least comes close to its greatest; what limits it
/// is the quadrature, which has to see all of the cell (docs/objectives.md has the figures).
std::vector<Stage> make_stages(const Options& options, int dimension);

}  // namespace varimesh
