// Which edges of a mesh layers cut, and where. Internal to core/layers.
#pragma once

#include <cstdint>
#include <vector>

#include "core/layers/split/edge_cut.h"
#include "core/layers/split/sheets.h"
#include "core/layers/split/split_layers.h"
#include "core/layers/split/wall_columns.h"

namespace varimesh::detail {

/// The cuts of all edges.
class LayerCuts {
 public:
  explicit LayerCuts(std::size_t edges) : cut_(edges, -1), along_(edges, 0) {}

  bool is_cut(std::int32_t edge) const { return cut_[std::size_t(edge)] >= 0; }
  int parts(std::int32_t edge) const { return cuts_[std::size_t(cut_[std::size_t(edge)])].parts(); }
  /// Which cut the edge has. Edges with the same cut, in the same direction, are cut at the same parameters.
  std::int32_t cut(std::int32_t edge) const { return cut_[std::size_t(edge)]; }
  bool is_along(const DirectedEdge& edge) const { return along_[std::size_t(edge.edge)] == edge.is_forward; }
  /// The parameter, 0 … 1 in the direction of the edge, of the point with the share ξ of the nodes of a part. Parts are
  /// counted in the direction of the edge.
  double parameter(const DirectedEdge& edge, int part, double xi) const {
    const EdgeCut& cut = cuts_[std::size_t(cut_[std::size_t(edge.edge)])];
    return is_along(edge) ? cut.parameter(part, xi) : 1 - cut.parameter(cut.parts() - 1 - part, 1 - xi);
  }

  /// Cuts an edge; the cut begins where the directed edge does.
  void add(const DirectedEdge& edge, EdgeCut cut);
  /// Cuts an edge as another one.
  void copy(std::int32_t to, std::int32_t from, bool same_direction);

 private:
  std::vector<std::int32_t> cut_;
  std::vector<char> along_;  ///< By edge: whether the cut has its forward direction.
  std::vector<EdgeCut> cuts_;
};

/// Cuts the edges that rise from the wall, and those that must be cut alike. Fills in what the report says of heights.
/// If report.same_shares is set, all edges of a sheet are cut at the same parameters.
/// Errors: BadInput if a column is not high enough, or if layers from several sides do not go together.
Expected<LayerCuts> cut_layers(const HighOrderMesh& mesh, const Topology& topology, const Sheets& sheets,
                               const WallColumns& wall, const LayerOptions& wanted, LayerSplitReport& report);

}  // namespace varimesh::detail
