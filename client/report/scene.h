// What a report's page draws, as arrays of numbers.
#pragma once

#include <nlohmann/json.hpp>
#include <set>

#include "client/report/packing.h"
#include "client/report/stages.h"

namespace varimesh::client {

/// Elements that are marked whatever their colour, by number.
struct Marks {
  std::set<std::int64_t> uncertified[2];  ///< By stage: not certified valid.
  std::set<std::int64_t> unrepairable;
};

/// Packs what page/view_2d.js (or view_3d.js) draws and returns what they have to know beside the arrays:
/// {"dimension", "centre", "box", "stages": ["before", …], "worst": {stage: [{"number", "scaled_jacobian", "place",
/// "size", "cell"}]}, …}. `cell` counts the cells that are in the arrays.
nlohmann::ordered_json pack_scene(const Stages& stages, const Marks& marks, Packing* packing);

/// Of pack_scene. In 2-D: all cells, edges as cubic Bézier curves.
nlohmann::ordered_json pack_cells_2d(const Stages& stages, Packing* packing, std::vector<std::int32_t>* shown);
/// In 3-D: the faces of the boundary and of the worst cells, on lattices.
nlohmann::ordered_json pack_cells_3d(const Stages& stages, Packing* packing, std::vector<std::int32_t>* shown);

}  // namespace varimesh::client
