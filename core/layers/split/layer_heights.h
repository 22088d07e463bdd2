// The heights of the layers into which thick cells at a wall are split. Internal to core/layers.
#pragma once

#include <vector>

#include "core/options/layer_options.h"

namespace varimesh::detail {

/// The number of layers, not counting a cell that remains above them. `column` is the height of a typical column.
int number_of_layers(const LayerOptions& wanted, double column);

/// The heights of `layers` layers in a column of this height, from the wall. If the layers do not fill columns, these
/// are the given heights. Empty if the column is not high enough. In a column that was grown (LayerOptions::grow),
/// given heights are in proportion to its height, and layers that do not fit are equally high.
std::vector<double> heights_in_column(const LayerOptions& wanted, int layers, double column);

}  // namespace varimesh::detail
