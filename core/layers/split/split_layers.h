// Splits thick cells at a wall into thin layers.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/layers/split/layer_heights.h"
#include "core/mesh/checked_mesh.h"
#include "core/options/options.h"

namespace varimesh {

/// What is wanted.
struct LayerSplit {
  /// Groups of boundary elements: names or tags of physical groups, or tags of entities.
  std::vector<std::string> walls;
  LayerHeights heights;
  /// How many rows of cells above the wall are split. The sides between rows stay. So the heights within each row are
  /// stretched until layers begin and end there.
  int rows = 1;
  /// How nodes are spaced inside the new cells, across the layers: graded as the layers grow, or evenly. Keep is Even.
  LayerSpacing spacing = LayerSpacing::Graded;
};

/// What came of it. Pairs are the smallest and the largest value; heights are in the mesh's unit of length.
struct LayerSplitReport {
  std::int64_t wall_elements = 0;
  std::int64_t columns = 0;   ///< Edges that rise from the wall.
  int layers = 0;             ///< In each column, without a cell that is left.
  bool leaves_cells = false;  ///< Whether the layers leave a part of the rows, which is one more cell.
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
/// or the edge leans by more than 60°.
///
/// If all cells that are split are certified valid, but not all of their parts, then layers get the same share of every
/// edge instead, and an even spacing, if fewer parts are left by that. Exact parts of valid cells are valid.
///
/// The result does not depend on the number of threads. Do not call it inside team.run(). Errors: BadOption and
/// BadInput, for heights that are no heights or higher than the cells, walls that do not exist, and cells that cannot
/// be split.
Expected<SplitLayers> split_layers(const CheckedMesh& mesh, const LayerSplit& wanted, const Team& team);

}  // namespace varimesh
