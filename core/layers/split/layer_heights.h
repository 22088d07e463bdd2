// The heights of the layers into which thick cells at a wall are split. Internal to core/layers.
#pragma once

#include <vector>

#include "core/options/layer_options.h"

namespace varimesh::detail {

/// The number of layers, without the cell that may be left. `column` is the height of a typical column.
int number_of_layers(const LayerOptions& wanted, double column);

/// The heights of `layers` layers in a column of this height, from the wall. If the layers do not fill columns, they
/// are the given ones. If the column is not high enough: empty, or lower heights if the column was grown for want of a
/// thick cell.
std::vector<double> heights_in_column(const LayerOptions& wanted, int layers, double column);

}  // namespace varimesh::detail
