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

/// Corners that lie within a fence of three fixed directions and have no room there.
struct LinkFault {
  std::vector<std::int32_t> corners;
  double determinant = 0;  ///< Of the three directions, counter-clockwise.
  double angle = 0;        ///< Solid angle that the piece claims, in [0, 4π].
  double room = 0;         ///< What the boundary leaves for all pieces; 0 where this piece has none whatever it claims.
};

/// The pieces at one vertex that no movement of free nodes can repair.
std::vector<LinkFault> link_faults(std::span<const LinkDirection> directions, std::span<const LinkCorner> corners);

/// Solid angle in [0, 4π) to the left of b → c → d → b for three unit vectors.
double solid_angle(const Vector& b, const Vector& c, const Vector& d);

}  // namespace varimesh::detail
