// What came of layers, as a message of the contract.
#pragma once

#include "core/layers/split/split_layers.h"
#include "varimesh/v1/optimise.pb.h"

namespace varimesh::server {

/// Without the quality of the mesh before it was split.
v1::LayersReport to_proto(const LayerSplitReport& report);

}  // namespace varimesh::server
