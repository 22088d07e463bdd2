// Sizes and strains that users hand in, checked and turned into what the targets are made with.
#pragma once

#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"
#include "core/options/options.h"

namespace varimesh {

/// Reads a field from text: a first line "elements" (a value a cell) or "nodes" (a value a vertex), then a line "number
/// value" each, or "number xx xy yy" (2-D) or "number xx xy yy xz yz zz" (3-D) for a tensor; separated by blanks; empty
/// lines and what follows a # are passed over. Errors: BadInput with the line.
Expected<TargetField> read_target_field(std::string_view text);

/// A field as the targets use it: for each cell (in the mesh's order) or node the stretch S, symmetric and positive.
/// For a size S is h or M^(−1/2), a length; for a strain it is 1 + ε or 1 + E, without a unit. Interpolating S, and not
/// M, between vertices keeps a size that grows by equal steps just that.
struct StretchField {
  Target target = Target::StraightSided;
  Per per = Per::Cell;
  int components = 0;  ///< 0: no field; 1: S is a number; else its lower triangle by rows.
  std::vector<double> values;
};

/// Matches the options' field with the mesh. Errors: BadInput for a number that the mesh does not have or that comes
/// twice, a cell or vertex without a size, a size, metric or 1 + strain that is not positive; BadOption where
/// `components` or the number of values does not fit.
Expected<StretchField> resolve_target_field(const HighOrderMesh& mesh, const Options& options);

}  // namespace varimesh
