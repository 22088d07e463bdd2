// The cells around a fixed vertex as spherical polygons, and the room that the boundary leaves them. Internal to the
// library.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/diagnosis/vector.h"

namespace varimesh::detail {

/// A mesh edge as seen from the vertex.
struct LinkDirection {
  Vector unit{};       ///< Its tangent at the vertex, of length one; zero if it has none.
  bool fixed = false;  ///< Whether all nodes of the edge are fixed.
};

/// A cell's corner at the vertex: the directions of its edges, counter-clockwise as seen from outside the sphere.
struct LinkCorner {
  std::int32_t cell = 0;
  std::array<std::int32_t, 4> direction{-1, -1, -1, -1};  ///< Three, or four at a pyramid's apex.
  int size() const { return direction[3] < 0 ? 3 : 4; }
};

/// Corners that cannot all be positive: either a fence of fixed directions leaves them no room, or they share one free
/// direction that cannot be on the right side of all of them at once.
struct LinkFault {
  std::vector<std::int32_t> corners;
  int fence = 0;                     ///< How many fixed directions enclose the corners; 0 for a free direction.
  std::int32_t free_direction = -1;  ///< The direction that the corners share; −1 for a fence.
  /// For a fence of three, the determinant of its directions, counter-clockwise. For a larger fence, the smallest
  /// determinant of three in a row. For a free direction x, the largest value over all x of the smallest n · x, where n
  /// is a corner's unit normal b × c of its fixed directions.
  double determinant = 0;
  double angle = 0;  ///< Solid angle that the piece claims, in [0, 4π].
  double room = 0;   ///< What the boundary leaves for all pieces; 0 if this piece has no room whatever it claims.
};

/// The pieces at one vertex that no movement of free nodes can repair. diagnose.h has the conditions.
std::vector<LinkFault> link_faults(std::span<const LinkDirection> directions, std::span<const LinkCorner> corners);

/// Solid angle in [0, 4π) to the left of b → c → d → b for three unit vectors.
double solid_angle(const Vector& b, const Vector& c, const Vector& d);

}  // namespace varimesh::detail
