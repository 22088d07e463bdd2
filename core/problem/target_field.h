// The sizes and strains that users give: reads them, checks them and turns them into stretches for the targets.
#pragma once

#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"
#include "core/options/options.h"

namespace varimesh {

/// Reads a field from text. The first line is "elements" (one value per cell) or "nodes" (one value per vertex). Then
/// comes one line per value: "number value", or for a tensor "number xx xy yy" (2-D) or "number xx xy yy xz yz zz"
/// (3-D), separated by blanks. Empty lines and everything after a # are ignored. Errors: BadInput with the line.
Expected<TargetField> read_target_field(std::string_view text);

/// A field as the targets use it: the stretch S, symmetric and positive definite, of each cell (in the mesh's order) or
/// node. For a size S is h or M^(−1/2), a length; for a strain it is 1 + ε or 1 + E, dimensionless. Between vertices S
/// is interpolated and not M, so a size that grows linearly stays linear.
struct StretchField {
  Target target = Target::StraightSided;
  Per per = Per::Cell;
  int components = 0;          ///< 0: no field; 1: S is a number; else d (d + 1)/2: its lower triangle by rows.
  std::vector<double> values;  ///< (cells or nodes) × components.
};

/// Matches options.target_field with the mesh. Errors: BadInput if a number is not in the mesh or occurs twice, if a
/// cell or vertex has no size, or if a size, metric or 1 + strain is not positive; BadOption if `components` or the
/// number of values does not fit.
Expected<StretchField> resolve_target_field(const HighOrderMesh& mesh, const Options& options);

}  // namespace varimesh
