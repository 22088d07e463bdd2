// How much room a vertex leaves the tetrahedra in each fence of fixed edges. Internal to core/repair.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/diagnosis/vertex_link.h"

namespace varimesh::detail {

/// Corners at a vertex that are joined across link sides with a free end.
struct LinkPiece {
  std::vector<std::int32_t> corners;                          ///< In order.
  std::vector<std::pair<std::int32_t, std::int32_t>> fence;   ///< Sides between fixed directions, another piece behind.
  std::vector<std::pair<std::int32_t, std::int32_t>> inside;  ///< Sides with a free end, once each.
  /// The largest that the smallest det of a corner's three unit directions can become by turning the free ones, as far
  /// as a search finds it; of a fence of three that of its directions. −1 where only solutions are found that go more
  /// than once round a free direction.
  double margin = 0;
};

/// The pieces at one vertex. Corners are triangles: of tetrahedra.
std::vector<LinkPiece> link_pieces(std::span<const LinkDirection> directions, std::span<const LinkCorner> corners,
                                   double enough);

}  // namespace varimesh::detail
