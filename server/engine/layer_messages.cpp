#include "server/engine/layer_messages.h"

#include <array>

namespace varimesh::server {
namespace {

v1::LayersReport::Range to_proto(const std::array<double, 2>& range) {
  v1::LayersReport::Range message;
  message.set_least(range[0]);
  message.set_most(range[1]);
  return message;
}

}  // namespace

v1::LayersReport to_proto(const LayerSplitReport& report) {
  v1::LayersReport message;
  message.set_wall_elements(report.wall_elements);
  message.set_columns(report.columns);
  message.set_layers(report.layers);
  message.set_leaves_cells(report.leaves_cells);
  message.set_split(report.split);
  message.set_split_beside(report.beside);
  message.set_elements_before(report.cells_before);
  message.set_elements_after(report.cells_after);
  *message.mutable_first_height() = to_proto(report.first);
  *message.mutable_last_height() = to_proto(report.last);
  *message.mutable_growth() = to_proto(report.growth);
  message.set_same_shares(report.same_shares);
  message.set_stretched(report.stretched);
  return message;
}

v1::LayersReport to_proto(const GrownLayer& grown) {
  v1::LayersReport message;
  *message.mutable_grown() = to_proto(grown.thickness);
  message.set_full_share(grown.full_share);
  return message;
}

}  // namespace varimesh::server
