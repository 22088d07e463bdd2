// How thick a row that was grown on walls is, from its growth to the marks in a file.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/mesh/checked_mesh.h"

namespace varimesh {

/// By the number of a node, for the vertices of the walls: the thickness of the row there over what was asked for, at
/// most 1. Nodes of walls keep their numbers while the mesh is curved, optimised and split.
using ThicknessShares = std::map<std::int64_t, double>;

/// By cell of the mesh: the smallest share at the vertices of the element of the wall that the cell stands on; 0 for
/// cells that stand on none. Empty if there are no shares. Errors: BadOption and BadInput for walls that do not exist.
/// @param walls  as LayerOptions::walls
Expected<std::vector<double>> thickness_of_cells(const CheckedMesh& mesh, std::span<const std::string> walls,
                                                 const ThicknessShares& shares);

/// The same for cells that are parts of other cells.
/// @param parents  by cell: the cell that it is a part of
std::vector<double> thickness_of_parts(std::span<const double> of_parents, std::span<const std::int32_t> parents);

}  // namespace varimesh
