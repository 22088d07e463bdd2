// The sides of cells as CGNS numbers them, which HOPR's files have too. Internal to core/formats.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/reference/shape.h"

namespace varimesh::formats {

/// A face of a 3-D cell, or an edge of a 2-D cell.
struct CgnsSide {
  int corners = 0;                      ///< 2, 3 or 4.
  std::array<std::int8_t, 4> vertices;  ///< Anticlockwise seen from outside, from the side's origin. Unused: −1.
  int facet = 0;                        ///< The same side in ShapeInfo::facets.
};

/// The sides in CGNS's order. Source: CGNS SIDS, "Unstructured Grid Element Numbering Conventions", TRI_3, QUAD_4,
/// TETRA_4, PYRA_5, PENTA_6 and HEXA_8.
std::span<const CgnsSide> cgns_sides(Shape shape);

}  // namespace varimesh::formats
