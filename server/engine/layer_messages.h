// What came of layers, as a message of the contract.
#pragma once

#include "core/layers/grow/grow_layer.h"
#include "core/layers/split/split_layers.h"
#include "varimesh/v1/optimise.pb.h"

namespace varimesh::server {

/// Without the quality of the mesh before it was split.
v1::LayersReport to_proto(const LayerSplitReport& report);
/// The fields about the row that was grown; the others are not set.
v1::LayersReport to_proto(const GrownLayer& grown);

}  // namespace varimesh::server
