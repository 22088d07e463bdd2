// The sentence about what a format has no place for. Internal to core/formats.
#pragma once

#include <algorithm>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <vector>

#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// Whether the nodes are numbered 1, 2, … in the mesh's order, as a reader counts those of a file without numbers.
inline bool are_nodes_counted(const HighOrderMesh& mesh) {
  std::int64_t next = 0;
  return std::ranges::all_of(mesh.node_numbers, [&](std::int64_t number) { return number == ++next; });
}

/// The same for the elements of these dimensions, all of one dimension before those of the next.
inline bool are_elements_counted(const HighOrderMesh& mesh, std::initializer_list<int> dimensions) {
  std::int64_t next = 0;
  for (const int dimension : dimensions)
    for (const ElementBlock& block : mesh.blocks) {
      if (reference::info(block.shape).dimension != dimension) continue;
      for (const std::int64_t number : block.numbers)
        if (number != ++next) return false;
    }
  return true;
}

/// Collects what a file leaves out.
class LeftOut {
 public:
  void add(std::string what) { all_.push_back(std::move(what)); }
  void add_if(bool lost, const char* what) {
    if (lost) all_.emplace_back(what);
  }
  /// "1 point" or "2 points"; nothing for 0.
  void count(std::int64_t n, const char* one, const char* more) {
    if (n > 0) all_.push_back(std::to_string(n) + " " + (n == 1 ? one : more));
  }
  /// Elements that are neither cells nor sides of cells.
  void small_elements(const HighOrderMesh& mesh) {
    for (int d = mesh.dimension - 2; d >= 0; --d)
      count(std::int64_t(mesh.element_count(d)), d == 0 ? "point" : "line", d == 0 ? "points" : "lines");
  }
  /// `n` elements on the boundary that are sides of no cell.
  void stray_sides(std::int64_t n) {
    count(n, "boundary element that is no side of an element", "boundary elements that are no sides of elements");
  }
  void numbers_if(bool lost) { add_if(lost, "the numbers of nodes and elements"); }
  /// What only Gmsh's formats have.
  void entities_and_partitions(const HighOrderMesh& mesh) {
    add_if(std::any_of(mesh.blocks.begin(), mesh.blocks.end(), [](const auto& b) { return !b.partitions.empty(); }),
           "partitions");
    add_if(!mesh.entities.empty(), "entities of the geometry");
  }

  /// `format`: for example "SU2's format". Empty if nothing is left out.
  std::string sentence(const std::string& format) const {
    std::string text;
    for (std::size_t i = 0; i < all_.size(); ++i)
      text += (i == 0 ? "" : i + 1 == all_.size() ? " and " : ", ") + all_[i];
    return text.empty() ? text : format + " has no place for " + text + "; the file leaves them out.";
  }

 private:
  std::vector<std::string> all_;
};

}  // namespace varimesh::formats
