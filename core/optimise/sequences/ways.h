// The ways that lead to a better mesh where others do not. Internal to core/optimise.
#pragma once

#include <array>

#include "core/options/options.h"

namespace varimesh {

/// Options that lead to a better mesh where others do not.
struct Way {
  Objective objective;
  Energy energy;
  Constants constants;
  Target target;
  const char* name;
};

/// In the order in which they are tried. No way makes all meshes valid that another way makes valid: the hyperelastic
/// energy helps in thin layers, Winslow's and the distortion energy at re-entrant corners, and ideal targets where
/// straight-sided cells are tangled. The constants of the reference lower the loss of a valid mesh from which the
/// descent finds no way.
inline constexpr std::array kWays{
    Way{Objective::Auto, Energy::Hyperelastic, Constants::Standard, Target::StraightSided, "the default objective"},
    Way{Objective::Energy, Energy::Hyperelastic, Constants::Standard, Target::StraightSided,
        "the optimum of the hyperelastic energy"},
    Way{Objective::Energy, Energy::Winslow, Constants::Standard, Target::StraightSided, "the Winslow energy"},
    Way{Objective::Energy, Energy::Hyperelastic, Constants::Standard, Target::Ideal, "ideal targets"},
    Way{Objective::Energy, Energy::Distortion, Constants::Standard, Target::StraightSided, "the distortion energy"},
    Way{Objective::Energy, Energy::Hyperelastic, Constants::Reference, Target::StraightSided,
        "the constants of the reference"},
};

/// The options of a run that goes this way.
inline Options with_way(Options options, const Way& way) {
  options.objective = way.objective;
  options.min_js = Options().min_js;  // which is an option of the accuracy
  options.energy = way.energy;
  options.constants = way.constants;
  options.target = way.target;
  return options;
}

/// The optimum of the energy is tried before the other energies, and repeats the beginning of the run. So it may
/// untangle as deeply as a run does, and do more work than the other attempts.
inline bool is_plain_energy(const Options& options) {
  return options.objective == Objective::Energy && options.energy == Energy::Hyperelastic &&
         options.target == Target::StraightSided && options.constants == Constants::Standard;
}

}  // namespace varimesh
