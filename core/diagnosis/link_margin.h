// How much room a vertex leaves the tetrahedra inside each fence of fixed edges. Internal to the library.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/diagnosis/vertex_link.h"

namespace varimesh::detail {

/// Corners at a vertex that are joined across sides of the link with a free end.
struct LinkPiece {
  std::vector<std::int32_t> corners;                          ///< In ascending order.
  std::vector<std::pair<std::int32_t, std::int32_t>> fence;   ///< Sides between fixed directions, with another piece
                                                              ///< behind.
  std::vector<std::pair<std::int32_t, std::int32_t>> inside;  ///< Sides with a free end, once each.
  /// Dimensionless. For a fence of three, the determinant of its unit directions. Otherwise the largest value that the
  /// smallest determinant of a corner's three unit directions can reach when the free ones turn, as far as a search
  /// finds it. −1 if only solutions were found that go around a free direction more than once.
  double margin = 0;
};

/// The pieces at one vertex, which must have triangles as corners (of tetrahedra). The search for a margin ends once
/// the margin is above `enough`.
std::vector<LinkPiece> link_pieces(std::span<const LinkDirection> directions, std::span<const LinkCorner> corners,
                                   double enough);

}  // namespace varimesh::detail
