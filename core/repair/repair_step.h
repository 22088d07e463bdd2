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
  };
  Kind kind = Kind::Left;
  std::vector<std::int64_t> vertices;  ///< Nodes at the ends of the split edge or the corners of the split face.
  std::int64_t node = 0;               ///< The new vertex; 0 if there is none.
  std::vector<std::int64_t> elements;  ///< A split element's number stays with one of its parts.
  /// The other parts: one per element, in the same order, or two per element if a face was split.
  std::vector<std::int64_t> new_elements;
  std::string sentence;  ///< For humans: what was done, or why not.
};

}  // namespace varimesh
