// How sentences for humans name elements.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace varimesh {

/// "tetrahedron 4711", or "tetrahedra 12, 13 and 20 more": at most eight numbers. `name` is for one element, `plural`
/// for several, as in ShapeInfo.
std::string elements_text(const std::vector<std::int64_t>& elements, std::string_view name, std::string_view plural);

/// "Element 3 is numbered clockwise", "All 480 elements are numbered clockwise", or "2 elements are numbered clockwise:
/// elements 3 and 5". In space, "clockwise (left-handed)". No full stop.
/// @param of how many elements the mesh has
std::string clockwise_text(const std::vector<std::int64_t>& elements, std::size_t of, int dimension);

}  // namespace varimesh
