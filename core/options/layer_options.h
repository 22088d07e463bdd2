// What a user can choose about thin layers into which thick cells at a wall are split. The contract, the flags and the
// documentation use the same names.
#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/options/options.h"

namespace varimesh {

inline constexpr int kMostLayers = 1000;

/// The walls, and the heights of the layers from the wall. Lengths are in the mesh's unit; 0 means that a number is not
/// given.
///
///   layers and first    the growth is chosen for each column, such that the layers fill it
///   layers and growth   the first height is chosen for each column, such that the layers fill it
///   first and growth    the number of layers is chosen, and then the growth for each column as above
///   all three           as given; what is left of a column is one more cell
///   heights             as given; what is left of a column is one more cell
///
/// layer_option_table() has the range of each option.
struct LayerOptions {
  /// Groups of boundary elements: names or tags of physical groups, or tags of entities; "all": the whole boundary.
  std::vector<std::string> walls;
  int layers = 0;
  double first = 0;   ///< Height of the layer at the wall.
  double growth = 0;  ///< Height of each layer divided by the height of the layer below it, dimensionless.
  std::vector<double> heights;
  /// How many rows of cells above the wall are split. The sides between rows stay. So the heights within each row are
  /// stretched until layers begin and end there.
  int rows = 1;
  /// How nodes are spaced inside the new cells, across the layers: graded as the layers grow, or evenly; never Keep.
  LayerSpacing spacing = LayerSpacing::Graded;
  /// Above 0: the walls have no thick cells yet, and a row of this thickness is grown on them before the mesh is
  /// optimised (core/layers/grow/grow_layer.h). Where there is no room it is thinner.
  double grow = 0;
  bool simplices = false;  ///< Cut all cells of the result into triangles or tetrahedra.

  /// The height of all layers together, as far as it is known without a column; 0: they fill a column, and the first
  /// height and the number do not tell.
  double height() const;
  /// Whether the layers fill a column whatever its height is.
  bool fills() const { return heights.empty() && (layers == 0 || first == 0 || growth == 0) && layers != 1; }
};

/// Checks what does not depend on the mesh. Errors: BadOption if there is no wall, or if numbers are missing,
/// contradict each other or are not possible.
Expected<void> check(const LayerOptions& options);

}  // namespace varimesh
