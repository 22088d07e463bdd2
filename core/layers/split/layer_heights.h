// How high the layers are into which thick cells at a wall are split.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/error.h"

namespace varimesh {

/// The heights of layers, from the wall. Lengths are in the mesh's unit; 0 means that a number is not given.
///
///   layers and first    the growth is chosen for each column, such that the layers fill it
///   layers and growth   the first height is chosen for each column, such that the layers fill it
///   first and growth    the number of layers is chosen, and then the growth for each column as above
///   all three           as given; what is left of a column is one more cell
///   heights             as given; what is left of a column is one more cell
struct LayerHeights {
  int layers = 0;
  double first = 0;   ///< Height of the layer at the wall.
  double growth = 0;  ///< Height of each layer over the height of the one below, dimensionless.
  std::vector<double> heights;

  /// Whether the layers fill a column whatever its height is.
  bool fills() const { return heights.empty() && (layers == 0 || first == 0 || growth == 0) && layers != 1; }
};

inline constexpr int kMostLayers = 1000;

/// Errors: BadOption if numbers are missing, contradict each other or are not possible.
Expected<void> check(const LayerHeights& wanted);

namespace detail {

/// The number of layers, without the cell that may be left. `column` is the height of a typical column.
int number_of_layers(const LayerHeights& wanted, double column);

/// The heights of `layers` layers in a column of this height, from the wall. If the layers do not fill columns, they
/// are the given ones. Empty if the column is not high enough.
std::vector<double> heights_in_column(const LayerHeights& wanted, int layers, double column);

}  // namespace detail
}  // namespace varimesh
