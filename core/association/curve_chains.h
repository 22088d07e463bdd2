// Curves of a geometry that follow one another smoothly. Internal to core/association.
#pragma once

#include <vector>

#include "core/geometry/geometry.h"

namespace varimesh::detail {

/// Curves, each of which begins where the one before ends.
struct CurveChain {
  struct Link {
    int curve = -1;
    bool backwards = false;  ///< It is passed through from its last parameter to its first.
    int vertex_after = -1;   ///< The smooth vertex at which the next one begins; −1: none, the chain ends.
  };
  std::vector<Link> links;
  bool closed = false;
  std::vector<int> ends;  ///< The vertices at the ends; empty if it is closed.
};

struct SmoothVertices {
  std::vector<int> without_curves;  ///< Vertices at which no curve that counts ends.
  std::vector<CurveChain> chains;   ///< Of two curves or more, or of one closed curve whose vertex is smooth.
};

/// A vertex is smooth if two ends of curves that count meet there, with tangents that go on in the same direction, and
/// with the same surfaces around.
/// @param counts  by curve
/// @param cosine  of the largest angle between the tangents
SmoothVertices smooth_vertices(const geometry::Geometry& geometry, const std::vector<bool>& counts, double cosine);

}  // namespace varimesh::detail
