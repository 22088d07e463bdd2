// The table of sides: how each format numbers the edges and faces of a cell. Internal to core/formats and core/hdf.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/reference/shape.h"

namespace varimesh::formats {

/// The formats whose numbers differ from Gmsh's, which are those of ShapeInfo. Their sources are in sides.cpp.
enum class Sides : std::uint8_t {
  Mfem,       ///< Edges and faces, each from the vertex where its degrees of freedom begin.
  CgnsNodes,  ///< CGNS: edges and faces, each from the corner where the order of its nodes begins.
  Cgns,       ///< CGNS and HOPR: the sides of a cell, anticlockwise seen from outside.
  Nektar,     ///< The faces of Nektar++'s cells, whose points go from the first vertex to the second.
  Pyfr,       ///< The sides of PyFR's cells, with ascending vertices.
  Ism,        ///< The sides of ISM's cells, whose points go from the first vertex to the second and the fourth.
  Exodus,     ///< Exodus: edges in the order of their nodes, and the sides that side sets name.
  Abaqus,     ///< Abaqus: edges in the order of their nodes, and the faces S1, S2, … of surfaces.
};

/// The edges of a cell in the format's order, as pairs of Gmsh's local vertices. A line has itself.
std::span<const std::array<std::int8_t, 2>> edges_of(Sides format, Shape shape);

/// The faces of a cell in the format's order, with Gmsh's local vertices. A 2-D cell has itself for Mfem, and its edges
/// for the others.
std::span<const reference::Facet> faces_of(Sides format, Shape shape);

/// The number of corners of an edge or face: 2, 3 or 4.
constexpr int corners_of(const reference::Facet& side) {
  return side.vertices[2] < 0 ? 2 : side.vertices[3] < 0 ? 3 : 4;
}

/// For each side of a format, the number of the same side in another: `as` has each of them. Gmsh's facets are
/// ShapeInfo::facets.
std::array<std::int8_t, 6> same_sides(std::span<const reference::Facet> sides, std::span<const reference::Facet> as);

/// A side of a cell as CGNS numbers them.
struct CgnsSide {
  int corners = 0;                      ///< 2, 3 or 4.
  std::array<std::int8_t, 4> vertices;  ///< Anticlockwise seen from outside, from the side's origin. Unused: −1.
  int facet = 0;                        ///< The same side in ShapeInfo::facets.
};

/// The sides in CGNS's order.
std::span<const CgnsSide> cgns_sides(Shape shape);

}  // namespace varimesh::formats
