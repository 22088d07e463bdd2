// The cells of a mesh as arrays of numbers that the report page draws.
#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "client/report/packing.h"
#include "client/report/snapshots.h"

namespace varimesh::client {

/// Numbers of the elements that are marked in the picture.
struct Marks {
  std::array<std::set<std::int64_t>, 2> uncertified;  ///< Not certified valid, before and after.
  std::set<std::int64_t> unrepairable;
};

/// How far the boundary elements of a mesh lie from its CAD model, in the mesh's unit of length.
struct BoundaryDistanceArrays {
  std::vector<std::int64_t> numbers;            ///< Of the elements of dimension 2, in the file of the first mesh.
  std::vector<std::int32_t> surfaces;           ///< Their places in document.geometry.surfaces; −1: not there.
  std::array<std::vector<float>, 2> distances;  ///< The largest of each, before and after.
};

/// Packs the arrays that page/view_2d.js or page/view_3d.js draws. Returns what the page needs besides them:
/// {"dimension", "centre", "box", "snapshots": ["before", …], "worst": {snapshot: [{"number", "scaled_jacobian",
/// "place", "size", "cell"}]}, …}. "cell" is the index of the cell in the arrays. `more` gets the arrays that the page
/// unpacks only when it needs them; it stays empty if there are none.
nlohmann::ordered_json pack_scene(const Snapshots& snapshots, const Marks& marks,
                                  const BoundaryDistanceArrays& distances, Packing* packing, Packing* more);

/// The part of pack_scene() for 2-D: all cells, with edges as cubic Bézier curves. Appends the cells in the arrays to
/// `shown`.
nlohmann::ordered_json pack_cells_2d(const Snapshots& snapshots, Packing* packing, std::vector<std::int32_t>* shown);
/// The part of pack_scene() for 3-D: the faces on the boundary and the faces of the worst cells, on lattices. Faces on
/// the boundary whose distance is known have the arrays SET_surfaces and SET_distances_SNAPSHOT, with −1 for other
/// faces. Appends the cells in the arrays to `shown`. Of a large mesh, `packing` also gets the corners of the cells
/// that the first cut of the page goes through, and `more` gets the corners of all cells.
nlohmann::ordered_json pack_cells_3d(const Snapshots& snapshots, const BoundaryDistanceArrays& distances,
                                     Packing* packing, Packing* more, std::vector<std::int32_t>* shown);

/// The cells that the plane across an axis through the middle of the mesh goes through, in one of the snapshots.
std::vector<std::size_t> cells_cut_in_the_middle(const Snapshots& snapshots, std::size_t axis);
/// Packs the corners, numbers and scaled Jacobians of these cells of a 3-D mesh, for page/cut.js: the arrays
/// NAME_shapes, NAME_numbers, NAME_corners, and for each snapshot NAME_vertices_SNAPSHOT and NAME_js_SNAPSHOT.
void pack_corners(const Snapshots& snapshots, const std::vector<std::size_t>& chosen, const std::string& name,
                  Packing* packing);

}  // namespace varimesh::client
