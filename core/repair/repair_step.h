// What was done to which element so that the mesh could be made valid: plain data, and a sentence.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace varimesh {

/// One thing done, or not done, about elements that no movement of free nodes can repair. Numbers are the file's.
struct RepairStep {
  enum class Kind : std::uint8_t {
    SplitEdge,     ///< An interior edge was split in two, and every element round it with it.
    SplitFace,     ///< An interior face was split in three, and the elements on both sides with it.
    Straightened,  ///< Elements were made straight-sided as far as the boundary allows it.
    Left,          ///< Elements were left as they were; the sentence says why.
  };
  Kind kind = Kind::Left;
  std::vector<std::int64_t> vertices;      ///< Nodes at the ends of the edge or the corners of the face; else empty.
  std::int64_t node = 0;                   ///< The new vertex; 0 where there is none.
  std::vector<std::int64_t> elements;      ///< Each keeps its number; where it was split, for one of its parts.
  std::vector<std::int64_t> new_elements;  ///< The other parts: one an element in the same order, or two at a face.
  std::string sentence;                    ///< For humans: what was done, or why not.
};

/// "tetrahedron 4711", or "tetrahedra 12, 13 and 20 more" for many; `name` and `plural` as in ShapeInfo.
std::string elements_text(const std::vector<std::int64_t>& elements, std::string_view name, std::string_view plural);

}  // namespace varimesh
