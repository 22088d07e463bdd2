// Columns of vertices that rise from a curved wall through layers of cells. Internal to core/layers.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "core/mesh/connectivity.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::detail {

/// A boundary facet that belongs to a curved wall with layers.
struct WallFacet {
  Shape shape = Shape::Line;
  std::int32_t cell = -1;           ///< The cell behind it.
  std::vector<std::int32_t> nodes;  ///< In Gmsh's order, vertices first.
  bool is_thin = true;              ///< The cell is thin over it, and not only low.
};

/// The walls with layers, and the columns above their vertices. A column begins at a vertex of a wall. It rises from
/// vertex to vertex along the edges that point away from the wall. Level 0 is the wall.
struct Columns {
  std::vector<WallFacet> facets;
  std::vector<std::int32_t> column_of;  ///< By node: the column of a vertex; −1: it is in none.
  std::vector<std::int32_t> level;      ///< By node: its level in its column.
  /// By column: its vertices, lowest first.
  std::vector<std::vector<std::int32_t>> vertices;
  /// By column: the facets around its lowest vertex.
  std::vector<std::vector<std::int32_t>> facets_of;
  /// By column: the length of the shortest edge of the wall at its lowest vertex.
  std::vector<double> size;
  /// By column: what its first edge is shorter than.
  std::vector<double> reach;

  bool empty() const { return vertices.empty(); }
};

/// A cell is thin over a facet if it is less high than this times the facet's shortest edge.
inline constexpr double kThin = 0.5;
/// A cell is low over a facet if it is less high than this times the facet's shortest edge.
inline constexpr double kLow = 1.5;

/// Which walls have columns.
enum class Walls : std::uint8_t { Curved, All };

/// Finds the columns. A wall is a patch of boundary facets that share edges (in 2-D: vertices), bend by less than 40°
/// from one to the next, and have a thin cell behind each. If at least half of the facets of a patch with low cells
/// have a thin cell, all of them are one wall: at the nose of a body facets are shorter, and the same layers are not
/// thin. With Walls::Curved a wall counts only if one of its facets is curved. The first edge of a column is thin, or
/// low, too. Higher up a column goes on whatever its height, as long as one edge points on. With Walls::All it ends
/// where the layers of another wall begin. A facet does not count if the cells behind it are layers of another wall,
/// which become lower towards that wall.
Columns find_columns(const HighOrderMesh& mesh, const Facets& facets, Walls which = Walls::Curved);

}  // namespace varimesh::detail
