// The loss of accuracy with the threads of a team, and the memory that it takes.
#pragma once

#include <cstdint>
#include <span>

#include "core/base/team.h"
#include "core/mesh/mesh_counts.h"
#include "core/quality/accuracy/accuracy.h"
#include "core/ranks/ranks.h"

namespace varimesh {

/// Cells whose modes are computed in one product of matrices; more of them gain nothing. The product rounds differently
/// for other numbers of cells, so a part of a mesh must begin at a multiple of it in its block to get the same bits.
inline constexpr std::size_t kAccuracyBatch = 16;

/// cell_accuracy() and accuracy() with the team's threads. Do not call them inside team.run(). The team's token may
/// interrupt them. `sharers`: ranks that all have this mesh, and measure a share of its cells each.
CellAccuracy cell_accuracy(const HighOrderMesh& mesh, const Team& team, const Ranks& sharers = one_rank());
/// `ranks`: all of them have a part of the mesh, and get the loss of the whole.
Accuracy accuracy(const HighOrderMesh& mesh, const Team& team, const Ranks& ranks = one_rank());
/// The same of the mesh with its nodes at other coordinates, as HighOrderMesh::coordinates. `sharers`: as above.
Accuracy accuracy(const HighOrderMesh& mesh, std::span<const double> coordinates, const Team& team,
                  const Ranks& ranks = one_rank(), const Ranks& sharers = one_rank());

/// κ = N^(−1/d) of the local loss, N being the number of cells: a wave number of one over a mesh of equal cells.
double local_wave(const HighOrderMesh& mesh);

/// The local loss of a mesh with its nodes at `coordinates`. It is the loss with the same wave number in units of each
/// cell's own size, k h = κ, and counts all N cells alike: its square is 1/N Σ_E Σ_s κ^(2(P+1−s)) m_s². So it takes the
/// sizes of cells for what the mesher knew about the solution, and the sizes of cells far away do not change the weight
/// of cells near a body. The descent lowers it (core/solvers/descent). Infinite if det J = 0 in a cell. `sharers`: as
/// above.
double local_loss(const HighOrderMesh& mesh, std::span<const double> coordinates, const Team& team,
                  const Ranks& sharers = one_rank());

/// The most bytes that accuracy() has in use, beside the tables.
std::int64_t bytes_of_accuracy(const MeshCounts& counts);

/// The bytes of the tables, which are kept until the program ends.
std::int64_t bytes_of_accuracy_tables(const MeshCounts& counts);

}  // namespace varimesh
