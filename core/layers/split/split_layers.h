// Splits thick cells at a wall into thin layers.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/mesh/checked_mesh.h"
#include "core/options/layer_options.h"
#include "core/validity/certificate.h"

namespace varimesh {

/// What came of it. Pairs are the smallest and the largest value; heights are in the mesh's unit of length.
struct LayerSplitReport {
  std::int64_t wall_elements = 0;
  std::int64_t columns = 0;   ///< Edges that rise from the wall.
  int layers = 0;             ///< In each column, not counting a cell that remains above them.
  bool leaves_cells = false;  ///< Whether a part of the rows remains above the layers, as one more cell.
  std::int64_t split = 0;     ///< Cells that were split,
  std::int64_t beside = 0;    ///< and those of them that are not in the rows, split so that the mesh conforms.
  std::int64_t cells_before = 0, cells_after = 0;
  std::array<double, 2> first{}, last{}, growth{};
  /// Whether layers have the same share of each edge, although heights would differ less otherwise: elements would not
  /// all have been valid.
  bool same_shares = false;
  /// By how much of its height a layer differs from what was wanted; above 0 only if there are several rows.
  double stretched = 0;
};

struct SplitLayers {
  HighOrderMesh mesh;
  LayerSplitReport report;
  std::vector<std::int32_t> parents;  ///< By cell of `mesh`: the cell of the thick mesh that it is a part of.
  /// Of the cells of `mesh` as they are numbered. Empty if they were not certified in the end: cut into simplices, or
  /// in a plane that is not z = constant.
  std::vector<Certificate> certificates;
};

/// Splits the cells in the rows above the walls into layers. Layers are made from quadrilaterals, hexahedra, and prisms
/// that stand on a triangle. The map of a cell gives the nodes of its parts, so no shape changes: with an even spacing,
/// and where layers have the same share of every edge that rises from the wall, the parts are the isoparametric maps of
/// parts of the reference cell (D. Moxey, M. D. Green, S. J. Sherwin, J. Peiró, Comput. Methods Appl. Mech. Engrg. 283,
/// 2015, 636–650). Otherwise they interpolate such maps.
///
/// A 2-D mesh may lie in any plane. The mesh stays conforming. Cells beside the layers whose faces would be cut are cut
/// as well: through opposite edges of quadrilaterals as far as there are quadrilaterals, and triangles, pyramids and
/// tetrahedra into fans. Boundary elements are split with their cells, and keep groups and entities. Nodes and numbers
/// of all that is not split stay, bit for bit. The first part of an element keeps its number.
///
/// Heights are measured along the normal of the wall at its vertices, and along the edge itself where the wall is sharp
/// or the edge leans by more than 60°. In thick cells that were grown (LayerOptions::grow) they are measured along the
/// normal there, too; where the wall is sharp, this is the normal of the wall element that makes the largest angle with
/// the edge.
///
/// If all cells that are split are certified valid, but not all of their parts, then layers get the same share of every
/// edge instead, and an even spacing, if fewer parts are left by that. Exact parts of valid cells are valid.
///
/// With LayerOptions::simplices, all cells are cut into simplices in the end (core/mesh/changes/to_simplices.h).
///
/// In thick cells that were grown (LayerOptions::grow), layers get lower where they would not fit.
///
/// The result does not depend on the number of threads. Do not call it inside team.run(). Errors: BadOption and
/// BadInput, for heights that are no heights or higher than the cells, walls that do not exist, and cells that cannot
/// be split.
Expected<SplitLayers> split_layers(const CheckedMesh& mesh, const LayerOptions& wanted, const Team& team);

/// The errors that split_layers() would return for walls, heights and cells above the walls, at less than its cost.
/// Otherwise how many cells there would be at most, before they are cut into simplices. The mesh may still be straight,
/// or tangled. If thick cells are to be grown first (LayerOptions::grow), only the walls are looked at.
Expected<std::int64_t> check_layers(const CheckedMesh& mesh, const LayerOptions& wanted, const Team& team);

}  // namespace varimesh
