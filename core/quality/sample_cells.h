// Samples det ∇χ_M in the cells of a mesh, by one process or by several. Internal to the library.
#pragma once

#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"
#include "core/quality/lattice_kernel.h"
#include "core/ranks/ranks.h"
#include "core/validity/cell_batches.h"

namespace varimesh::detail {

/// The cells of the mesh in batches of lattice_lanes().
std::vector<CellBatch> batches_to_sample(const HighOrderMesh& mesh);

/// Samples some of these batches, with the nodes at `coordinates` (HighOrderMesh::coordinates). `cells` has one entry
/// per cell of the mesh. Call it inside team.run().
void sample_cells(const HighOrderMesh& mesh, std::span<const double> coordinates, int intervals,
                  std::span<const CellBatch> batches, const Team& team, std::span<Extremes> cells);

/// Ranks that all have the whole mesh and call sample() together. Each samples a share of the cells, and all get all.
class SamplesOfRanks final : public SamplesElsewhere {
 public:
  explicit SamplesOfRanks(const Ranks& ranks) : ranks_(ranks) {}

  bool sample(const HighOrderMesh& mesh, std::span<const double> coordinates, int intervals, const Team& team,
              std::vector<Extremes>& cells) override;
  const Ranks& sharers() const override { return ranks_; }

 private:
  const Ranks& ranks_;
};

}  // namespace varimesh::detail
