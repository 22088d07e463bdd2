// A run whose result gets thin layers.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/team.h"
#include "core/layers/split/split_layers.h"
#include "core/layers/thickness_shares.h"
#include "core/optimise/result.h"

namespace varimesh {

/// What came of layers in a run.
struct LayersMade {
  LayerSplitReport report;
  QualityReport thick;  ///< The quality of the mesh before it was split.
  /// By cell of the mesh with layers: see thickness_of_cells(). Empty if no row was grown for this run.
  std::vector<double> thickness;
};

/// Splits the thick cells of the result into layers. `after`, `left`, `unrepairable` and the sizes become those of the
/// mesh with layers. Errors: those of split_layers(); the result is then as it was, without its mesh.
/// @param grown  how thick the cells are, if they were grown for this run
Expected<LayersMade> split_result(Result& result, const LayerOptions& wanted, const ThicknessShares& grown,
                                  int threads);

/// The bytes that layers add at most to what a run has in use, growing thick cells included: an estimate. Errors: those
/// of check_layers().
/// @param run    what the run has in use without layers
/// @param order  of the result; 0: that of the mesh
Expected<std::int64_t> memory_of_layers(const CheckedMesh& mesh, const LayerOptions& wanted, std::int64_t run,
                                        int order, const Team& team);

}  // namespace varimesh
