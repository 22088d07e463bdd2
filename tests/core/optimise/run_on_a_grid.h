// Runs on grids of cells, for tests of runs that several ranks share.
#pragma once

#include <array>
#include <ostream>

#include "core/optimise/optimiser.h"
#include "tests/core/support/meshes.h"

namespace varimesh::testing {

/// A run with one thread on a grid of bent cells.
struct RunOnAGrid {
  const char* name;
  Filling filling;
  std::array<int, 3> counts;
  int order;
  double shake;  ///< .3 turns cells over
  Objective objective = Objective::Energy;
  bool has_two_parts = true;  ///< It has enough cells for two ranks.

  Options options() const {
    Options options;
    options.objective = objective;
    options.threads = 1;
    return options;
  }
  HighOrderMesh mesh() const {
    HighOrderMesh mesh = grid(filling, counts, order, bent(is_plane(filling) ? 2 : 3));
    testing::shake(mesh, shake, 7);
    return mesh;
  }
};

inline void PrintTo(const RunOnAGrid& one, std::ostream* out) { *out << one.name; }

}  // namespace varimesh::testing
