// Options of tests that are about the energy's optimum, which is not the default objective.
#pragma once

#include "core/options/options.h"

namespace varimesh::testing {

inline Options for_energy() {
  Options options;
  options.objective = Objective::Energy;
  return options;
}

}  // namespace varimesh::testing
