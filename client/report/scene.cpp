// The part that 2-D and 3-D share: numbers, qualities and marks of the cells that are shown.
#include "client/report/scene.h"

#include <algorithm>

namespace varimesh::client {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kWorst = 10;  ///< Rows of the table of the worst elements.

/// Bits of the array "marks"; page/cells.js has the same.
enum Mark : std::uint8_t { kUncertifiedBefore = 1, kUncertifiedAfter = 2, kUnrepairable = 4 };

Json worst_document(const Snapshots& snapshots, std::size_t snapshot, const std::vector<std::int32_t>& index_of) {
  Json rows = Json::array();
  for (const std::int32_t cell : snapshots.worst(snapshot, kWorst)) {
    const auto c = static_cast<std::size_t>(cell);
    Json row = {{"number", snapshots.cells().number(c)},
                {"shape", reference::info(snapshots.cells().shape(c)).name},
                {"scaled_jacobian", snapshots[snapshot].scaled_jacobian[c]},
                {"place", snapshots.middle(snapshot, c)},
                {"size", snapshots.size(snapshot, c)}};
    if (index_of[c] >= 0) row["cell"] = index_of[c];
    rows.push_back(std::move(row));
  }
  return rows;
}

void pack_cell_data(const Snapshots& snapshots, const Marks& marks, const std::vector<std::int32_t>& shown,
                    Packing* packing) {
  // The numbers mostly increase by one, so their differences compress well.
  std::vector<double> numbers;
  std::vector<std::uint8_t> bits;
  double last = 0;
  for (const std::int32_t cell : shown) {
    const std::int64_t number = snapshots.cells().number(static_cast<std::size_t>(cell));
    numbers.push_back(static_cast<double>(number) - last);
    last = static_cast<double>(number);
    int bit = 0;
    if (marks.uncertified[0].count(number) != 0) bit |= kUncertifiedBefore;
    if (marks.uncertified[1].count(number) != 0) bit |= kUncertifiedAfter;
    if (marks.unrepairable.count(number) != 0) bit |= kUnrepairable;
    bits.push_back(static_cast<std::uint8_t>(bit));
  }
  packing->add("numbers", numbers);
  packing->add("marks", bits);
  for (std::size_t s = 0; s < snapshots.count(); ++s) {
    std::vector<float> js;
    for (const std::int32_t cell : shown)
      js.push_back(static_cast<float>(snapshots[s].scaled_jacobian[static_cast<std::size_t>(cell)]));
    packing->add(std::string("js_") + Snapshots::name(s), js);
  }
}

}  // namespace

Json pack_scene(const Snapshots& snapshots, const Marks& marks, const BoundaryDistanceArrays& distances,
                Packing* packing, Packing* more) {
  std::vector<std::int32_t> shown;
  Json scene = snapshots.mesh().dimension == 2 ? pack_cells_2d(snapshots, packing, &shown)
                                               : pack_cells_3d(snapshots, distances, packing, more, &shown);
  pack_cell_data(snapshots, marks, shown, packing);
  std::vector<std::int32_t> index_of(snapshots.cells().count(), -1);
  for (std::size_t i = 0; i < shown.size(); ++i) index_of[static_cast<std::size_t>(shown[i])] = static_cast<int>(i);
  scene["dimension"] = snapshots.mesh().dimension;
  scene["cells"] = snapshots.cells().count();
  scene["shown"] = shown.size();
  scene["centre"] = snapshots.centre();
  scene["box"] = snapshots.box();
  scene["snapshots"] = Json::array();
  for (std::size_t s = 0; s < snapshots.count(); ++s) {
    scene["snapshots"].push_back(Snapshots::name(s));
    scene["worst"][Snapshots::name(s)] = worst_document(snapshots, s, index_of);
  }
  return scene;
}

}  // namespace varimesh::client
