// The six blocks between the sphere and the cube, and the numbers of the lattice points on the surface of the cube.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace varimesh::bench {

using Point = std::array<double, 3>;
using Steps = std::array<int, 3>;  // along u, v and r of a block

inline double length(const Point& p) { return std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]); }

inline double distance(const Point& a, const Point& b) { return length({a[0] - b[0], a[1] - b[1], a[2] - b[2]}); }

/// Numbers the lattice points on the surface of a cube with n steps per edge, from 0.
struct Surface {
  int n;

  std::int64_t count() const { return std::int64_t{6} * n * n + 2; }
  std::int64_t number(const Steps& at) const {
    const std::int64_t side = n + 1, x = at[0], y = at[1], z = at[2];
    if (z == 0 || z == n) return (z == 0 ? 0 : side * side) + side * y + x;
    const std::int64_t ring = y == 0 && x < n ? x : x == n && y < n ? n + y : y == n && x > 0 ? 3 * n - x : 4 * n - y;
    return 2 * side * side + (z - 1) * 4 * n + ring;
  }
};

/// One of the six blocks: u and v are the axes along its face of the cube, in the order of x, y, z, and r leads
/// outwards.
struct Block {
  std::size_t normal;  ///< The axis that the face is normal to.
  bool upper;          ///< Whether the face lies at +1.

  std::size_t u() const { return normal == 0 ? 1 : 0; }
  std::size_t v() const { return normal == 2 ? 1 : 2; }
  /// Whether u, v, r are right-handed.
  bool right_handed() const { return (normal == 1) != upper; }
  /// The point (i, j) of the face in the lattice of a cube with n steps.
  Steps on_cube(int i, int j, int n) const {
    Steps at{};
    at[normal] = upper ? n : 0;
    at[u()] = i;
    at[v()] = j;
    return at;
  }
};

inline constexpr std::array<Block, 6> kBlocks{{{0, false}, {0, true}, {1, false}, {1, true}, {2, false}, {2, true}}};

}  // namespace varimesh::bench
