// What both dimensions share: numbers, qualities and marks of the cells that are shown.
#include "client/report/scene.h"

#include <algorithm>

namespace varimesh::client {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kWorst = 10;  ///< Rows of the table of the worst elements.

/// Bits of the array "marks", as page/cells.js has them.
enum Mark : std::uint8_t { kUncertifiedBefore = 1, kUncertifiedAfter = 2, kUnrepairable = 4 };

Json worst_document(const Stages& stages, std::size_t stage, const std::vector<std::int32_t>& place_of) {
  Json rows = Json::array();
  for (const std::int32_t cell : stages.worst(stage, kWorst)) {
    const auto c = static_cast<std::size_t>(cell);
    Json row = {{"number", stages.cells().number(c)},
                {"shape", reference::info(stages.cells().shape(c)).name},
                {"scaled_jacobian", stages[stage].scaled_jacobian[c]},
                {"place", stages.middle(stage, c)},
                {"size", stages.size(stage, c)}};
    if (place_of[c] >= 0) row["cell"] = place_of[c];
    rows.push_back(std::move(row));
  }
  return rows;
}

void pack_cell_data(const Stages& stages, const Marks& marks, const std::vector<std::int32_t>& shown,
                    Packing* packing) {
  // Numbers mostly count upwards, and their differences pack to nothing.
  std::vector<double> numbers;
  std::vector<std::uint8_t> bits;
  double last = 0;
  for (const std::int32_t cell : shown) {
    const std::int64_t number = stages.cells().number(static_cast<std::size_t>(cell));
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
  for (std::size_t s = 0; s < stages.count(); ++s) {
    std::vector<float> js;
    for (const std::int32_t cell : shown)
      js.push_back(static_cast<float>(stages[s].scaled_jacobian[static_cast<std::size_t>(cell)]));
    packing->add(std::string("js_") + Stages::name(s), js);
  }
}

}  // namespace

Json pack_scene(const Stages& stages, const Marks& marks, Packing* packing) {
  std::vector<std::int32_t> shown;
  Json scene =
      stages.mesh().dimension == 2 ? pack_cells_2d(stages, packing, &shown) : pack_cells_3d(stages, packing, &shown);
  pack_cell_data(stages, marks, shown, packing);
  std::vector<std::int32_t> place_of(stages.cells().count(), -1);
  for (std::size_t i = 0; i < shown.size(); ++i) place_of[static_cast<std::size_t>(shown[i])] = static_cast<int>(i);
  scene["dimension"] = stages.mesh().dimension;
  scene["cells"] = stages.cells().count();
  scene["shown"] = shown.size();
  scene["centre"] = stages.centre();
  scene["box"] = stages.box();
  scene["stages"] = Json::array();
  for (std::size_t s = 0; s < stages.count(); ++s) {
    scene["stages"].push_back(Stages::name(s));
    scene["worst"][Stages::name(s)] = worst_document(stages, s, place_of);
  }
  return scene;
}

}  // namespace varimesh::client
