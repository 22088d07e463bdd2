// The cells round a fixed vertex as spherical polygons, and the room that the boundary leaves them. Internal to
// core/quality.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace varimesh::detail {

using Vector = std::array<double, 3>;

inline double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline double determinant(const Vector& a, const Vector& b, const Vector& c) { return dot(a, cross(b, c)); }

/// A mesh edge seen from the vertex.
struct LinkDirection {
  Vector unit{};       ///< Its tangent at the vertex, of length one; zero where it has none.
  bool fixed = false;  ///< All nodes of the edge are.
};

/// A cell's corner at the vertex: its edges' directions, counter-clockwise seen from outside the sphere.
struct LinkCorner {
  std::int32_t cell = 0;
  std::array<std::int32_t, 4> direction{-1, -1, -1, -1};  ///< Three, or four at a pyramid's apex.
  int size() const { return direction[3] < 0 ? 3 : 4; }
};

/// Corners that cannot all be positive: within a fence of fixed directions that leaves them no room, or round one
/// free direction that cannot be on the right side of all of them at once.
struct LinkFault {
  std::vector<std::int32_t> corners;
  int fence = 0;                     ///< How many fixed directions fence the corners in; 0: it is a free one.
  std::int32_t free_direction = -1;  ///< The one they have in common; −1 for a fence.
  /// Of the fence's three directions, counter-clockwise, or the smallest of three in a row where there are more; for a
  /// free direction the largest that the smallest of n · x can be, n a corner's unit normal b × c of its fixed
  /// directions and x the free one.
  double determinant = 0;
  double angle = 0;  ///< Solid angle that the piece claims, in [0, 4π].
  double room = 0;   ///< What the boundary leaves for all pieces; 0 where this piece has none whatever it claims.
};

/// The pieces at one vertex that no movement of free nodes can repair.
std::vector<LinkFault> link_faults(std::span<const LinkDirection> directions, std::span<const LinkCorner> corners);

/// Solid angle in [0, 4π) to the left of b → c → d → b for three unit vectors.
double solid_angle(const Vector& b, const Vector& c, const Vector& d);

}  // namespace varimesh::detail
