// Sheets of edges that must be cut alike. Internal to core/layers.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "core/mesh/high_order_mesh.h"
#include "core/mesh/topology.h"

namespace varimesh::detail {

/// An edge of the mesh, in one of its two directions.
struct DirectedEdge {
  std::int32_t edge = -1;  ///< Its number in the topology.
  bool is_forward = true;  ///< From its vertex with the lower number to the other one.
};

/// If one edge of a quadrilateral face is cut, then the opposite edge must be cut in as many parts. All edges that hang
/// together so are a sheet. Edges of a sheet that have the same direction begin on the same side of it.
class Sheets {
 public:
  /// `topology` must have the edges of the mesh's cells. Edges that are images of each other under a periodic link are
  /// in one sheet.
  Sheets(const HighOrderMesh& mesh, const Topology& topology);

  /// The sheet of an edge. A sheet has the number of one of its edges.
  std::int32_t sheet(std::int32_t edge) const { return root_[std::size_t(edge)]; }
  /// Whether the edge, in its forward direction, begins on the lower side of its sheet.
  bool begins_low(std::int32_t edge) const { return !turned_[std::size_t(edge)]; }
  /// Whether a sheet has no sides: an edge would be on both.
  bool is_twisted(std::int32_t sheet) const { return twisted_[std::size_t(sheet)]; }

  /// The edges opposite this one across a face, or its periodic images, each with whether it has the same forward
  /// direction.
  const std::vector<std::pair<std::int32_t, bool>>& opposite(std::int32_t edge) const {
    return opposite_[std::size_t(edge)];
  }

 private:
  void join(std::int32_t a, std::int32_t b, bool same);
  std::pair<std::int32_t, bool> find(std::int32_t edge);

  std::vector<std::int32_t> root_;
  std::vector<bool> turned_;
  std::vector<bool> twisted_;
  std::vector<std::vector<std::pair<std::int32_t, bool>>> opposite_;
};

}  // namespace varimesh::detail
