// What was done to which element so that the mesh could become valid: plain data, and a sentence.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace varimesh {

/// One thing that was done, or not done, about elements that no movement of free nodes can repair. Numbers are the
/// file's.
struct RepairStep {
  enum class Kind : std::uint8_t {
    SplitEdge,     ///< An edge was split in two, together with every element around it.
    SplitFace,     ///< An interior face was split in three, together with the elements on both sides.
    Straightened,  ///< Elements were made straight-sided as far as the boundary allows.
    Left,          ///< Elements were left as they were; the sentence says why.
    Swapped,       ///< The elements around an edge or face got others in their place, with the same vertices. On the
                   ///< boundary, there may be none.
    Collapsed,     ///< An interior vertex went to the other end of an edge; the elements along the edge disappeared.
  };
  Kind kind = Kind::Left;
  /// Nodes at the ends of the edge, or at the corners of the face, that was split, swapped or collapsed.
  std::vector<std::int64_t> vertices;
  std::int64_t node = 0;               ///< The new vertex; 0 if there is none.
  std::vector<std::int64_t> elements;  ///< A split element's number stays with one of its parts.
  /// Of a split: the other parts, one per element, in the same order, or two per element if a face was split. Of a swap
  /// or a collapse: the new elements, with numbers above all numbers before.
  std::vector<std::int64_t> new_elements;
  std::string sentence;  ///< For humans: what was done, or why not.
};

}  // namespace varimesh
