#include "core/optimise/stages.h"

#include <algorithm>

#include "core/energy/material.h"

namespace varimesh {
namespace {

/// Factor of λ and κ in a later stage, and its least p-norm.
struct Pressure {
  double bulk, p_norm;
};

constexpr Pressure kPressures[] = {{4, 2}, {16, 2}, {64, 2}};

Stage make_stage(const Options& options, int dimension) {
  Stage stage;
  stage.options = options;
  stage.kernels = make_kernels(material(options), dimension);
  const bool needs_hessian = options.method != Method::Sweeps || options.objective == Objective::Accuracy;
  if (needs_hessian) stage.hessian = make_hessian_kernels(material(options), dimension);
  return stage;
}

}  // namespace

std::vector<Stage> make_stages(const Options& options, int dimension) {
  std::vector<Stage> stages;
  stages.push_back(make_stage(options, dimension));
  if (options.objective != Objective::Worst) return stages;
  const Material first = material(options);
  const bool elastic = has_bulk_constant(first);
  for (const Pressure& pressure : kPressures) {
    if (!elastic && stages.size() > 1) break;  // the energy has no λ and κ: the next stage would be the same
    Options pressed = options;
    pressed.lambda = pressure.bulk * first.lambda;
    pressed.kappa = pressure.bulk * first.kappa;
    pressed.p_norm = std::max(options.p_norm, pressure.p_norm);
    stages.push_back(make_stage(pressed, dimension));
  }
  return stages;
}

}  // namespace varimesh
