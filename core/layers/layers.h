// Layers of cells at curved walls: nodes on surfaces parallel to the wall, which a run then leaves alone.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/connectivity.h"
#include "core/mesh/high_order_mesh.h"
#include "core/options/options.h"

namespace varimesh {

/// What nodes on flat sides do, at which a wall ends.
enum class OnFlatSides : std::uint8_t { Stay, Slide };

/// What became of the layers at curved walls.
struct LayerStart {
  /// 3 per node, interleaved, as HighOrderMesh::coordinates; empty: the mesh stays as it came.
  std::vector<double> coordinates;
  std::vector<char> held;   ///< By node: 1 if it lies where a layer wants it. Empty: no node is held that might move.
  std::int64_t cells = 0;   ///< Cells in layers.
  std::int64_t placed = 0;  ///< Those of them whose nodes were moved.
  std::int64_t made_valid = 0;  ///< Cells of the mesh that are certified valid only after that.
};

/// In a layer of thin cells the best cell is not the straight-sided one. Its nodes lie on surfaces parallel to the
/// wall, and are spaced across the layer as they came (core/layers/placement.h has the formula). Only then does a
/// solution that varies with the distance from the wall keep its accuracy, and only then do layers stay valid that are
/// thinner than the wall bends.
///
/// - In a mesh that is valid, cells stay as they are if their nodes lie near parallel surfaces: to within a fiftieth of
///   the height of the cell along the normal of the wall, and a tenth of its width along the wall.
/// - Otherwise the nodes of cells go to parallel surfaces if the cells are not certified valid or less high than
///   four times their width. Cells get their nodes back if they would lose a certificate by it, or do not become
///   valid.
/// - With a spacing that is not kept, the walls may be flat. The nodes of all cells that are at most twice as high as
///   wide go to parallel surfaces with that spacing. Nodes on flat sides at which a wall ends, such as planes of
///   symmetry, may slide in these sides to get the spacing too, unless they are in a periodic link.
/// - The nodes stay there if at least one cell of the mesh becomes certified valid by this, or if the spacing is not
///   kept. If all cells are valid then, the nodes of the cells of both kinds are held.
///
/// In a mesh whose cells are all certified valid, no node moves if the spacing is kept. Vertices never do. `fixed`: by
/// node, whether it must stay; with OnFlatSides::Slide nodes on flat sides need not. Call it inside team.run().
LayerStart start_layers(const HighOrderMesh& mesh, const Facets& facets, const std::vector<bool>& fixed,
                        LayerSpacing spacing, OnFlatSides on_flat_sides, const Team& team);

}  // namespace varimesh
