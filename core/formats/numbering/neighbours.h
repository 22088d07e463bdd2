// The neighbour of every side of every cell, across periodic boundaries too, and the boundary conditions. Internal to
// core/formats.
#pragma once

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/formats/numbering/sides.h"
#include "core/mesh/connectivity.h"

namespace varimesh::formats {

/// What is on the other side of a side.
struct SideNeighbour {
  std::size_t own_facet = 0;  ///< The side itself, counted through all cells.
  std::int64_t cell = -1;     ///< −1: none.
  std::size_t facet = 0;      ///< The neighbour's side, counted through all cells.
  int side = 0;               ///< The neighbour's side, counted from 1 in CGNS's order; 0: none.
  /// Which of the neighbour's corners, counted from 1, is the first corner of the side; 0: none.
  int flip = 0;
  int group = 0;  ///< Number of the boundary condition, counted from 1; 0: none.
};

/// A physical group of sides, as a boundary condition. Each side of a periodic link is a group of its own, also where
/// the mesh has both of them, or other sides too, in one group.
struct SideGroup {
  int tag = 0;  ///< 0 for sides without a group, and for periodic parts of a group.
  std::string name;
  int periodic = 0;       ///< Number of the periodic link, negative for its first side; 0: not periodic.
  bool inner = false;     ///< Whether all its sides lie between two cells.
  bool boundary = false;  ///< Whether some of its sides have nothing on the other side, nor a periodic image.
};

/// Refuses a mesh in which more than two cells share a side. `format`: its name in the sentence, such as "PyFR's".
/// Errors: BadOption.
Expected<void> check_two_at_sides(bool crowded, const char* format);
Expected<void> check_two_at_sides(const HighOrderMesh& mesh, const Team& team, const char* format);

class SideNeighbours {
 public:
  SideNeighbours(const HighOrderMesh& mesh, const Cells& cells, const Team& team);

  /// The elements of one dimension less than cells that are no sides of cells.
  std::int64_t stray() const { return stray_; }
  bool crowded() const { return facets_.crowded >= 0; }
  std::size_t side_count() const { return facets_.opposite.size(); }
  const std::vector<SideGroup>& groups() const { return groups_; }
  SideNeighbour of(std::size_t cell, const CgnsSide& side) const;
  /// The first side of a cell, counted through all cells.
  std::size_t first_facet(std::size_t cell) const;
  /// The same side of the neighbour, or its periodic image, counted through all cells; −1: none.
  std::int64_t other_facet(std::size_t facet) const {
    return is_inside(facet) ? facets_.opposite[facet] : image_of(facet);
  }
  /// Number of the boundary condition of a side, counted from 1; 0: none.
  int group_of(std::size_t facet) const { return group_of_facet_[facet]; }

  /// Where a side is.
  struct Place {
    std::size_t range;  ///< Of its cell in Cells::ranges().
    std::size_t cell;
    int facet;  ///< Which of the cell's facets it is, in the order of ShapeInfo::facets.
  };
  Place place_of(std::size_t facet) const {
    const auto after = std::upper_bound(runs_.begin(), runs_.end(), facet,
                                        [](std::size_t f, const Run& each) { return f < each.facet; });
    const Run& run = *std::prev(after);
    const auto inside = std::uint32_t(facet - run.facet), each = std::uint32_t(run.per_cell);
    return {std::size_t(after - runs_.begin()) - 1, run.cell + inside / each, int(inside % each)};
  }

 private:
  /// Cells of a block, and where their sides begin.
  struct Run {
    std::size_t cell = 0, facet = 0, per_cell = 1;
  };

  void find_groups();
  void find_periodic();
  void split_groups();
  bool is_inside(std::size_t facet) const { return facets_.opposite[facet] >= 0; }
  std::size_t facet_cell(std::size_t facet) const { return place_of(facet).cell; }
  /// The node at a corner of a side.
  std::int32_t corner(std::size_t cell, const CgnsSide& side, int k) const;
  const CgnsSide& side_of(std::size_t cell, std::size_t facet, int& number) const;

  const HighOrderMesh& mesh_;
  const Cells& cells_;
  Facets facets_;  ///< Without `first` and `neighbour`, which take 20 bytes per side and follow from the rest.
  std::vector<Run> runs_;
  std::vector<SideGroup> groups_;
  std::int64_t stray_ = 0;
  std::vector<std::int32_t> group_of_facet_;
  std::int64_t image_of(std::size_t facet) const { return image_.empty() ? -1 : image_[facet]; }

  /// For each facet: the facet that is its periodic image, or −1, and whether nodes are to be mapped with the link or
  /// against it. Empty if there are no periodic links.
  std::vector<std::int64_t> image_;
  std::vector<std::int32_t> image_link_;  ///< 1-based number of the link; negative for its second side.
  std::vector<std::vector<std::pair<std::int32_t, std::int32_t>>> there_, back_;  ///< Node pairs, sorted, per link.
};

}  // namespace varimesh::formats
