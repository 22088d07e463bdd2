// The distance of a mesh's boundary from its CAD model, by the faces of its cells.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include "client/report/scene.h"

namespace varimesh::client {

/// Finds the boundary element that a face of a cell is.
class FaceDistances {
 public:
  /// `distances` must outlive this object.
  FaceDistances(const Snapshots& snapshots, const BoundaryDistanceArrays& distances);

  bool any() const { return !place_of_.empty(); }
  /// The place of its surface in document.geometry.surfaces; −1: the face is no boundary element, or not known.
  std::int32_t surface(std::size_t cell, int facet) const;
  /// The largest distance between the face and its surface, in the mesh's unit of length; −1: not known.
  float distance(std::size_t snapshot, std::size_t cell, int facet) const;

 private:
  using Corners = std::array<std::int32_t, 4>;  ///< Sorted nodes; the last is −1 for a triangle.

  /// The place of the face in the arrays; −1: it is not there.
  std::ptrdiff_t place(std::size_t cell, int facet) const;

  const Snapshots& snapshots_;
  const BoundaryDistanceArrays& distances_;
  std::map<Corners, std::ptrdiff_t> place_of_;
};

}  // namespace varimesh::client
