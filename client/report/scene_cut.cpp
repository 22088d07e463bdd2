// The corners of the cells of a large 3-D mesh, from which the page draws the elements that a cut goes through.
#include <algorithm>
#include <cmath>

#include "client/report/scene.h"

namespace varimesh::client {
namespace {

/// The scaled Jacobian as one byte: 0 if it is not positive, otherwise 1 to 255 for (0, 1]. The page has 64 colours.
std::uint8_t as_byte(double scaled_jacobian) {
  if (!(scaled_jacobian > 0)) return 0;
  return static_cast<std::uint8_t>(std::clamp(static_cast<int>(std::ceil(255 * scaled_jacobian)), 1, 255));
}

/// Whether a cell has corners on both sides of the plane across an axis through the middle of the mesh.
bool is_cut(const Snapshots& snapshots, std::size_t snapshot, std::size_t cell, std::size_t axis) {
  bool below = false, above = false;
  for (int corner = 0; corner < reference::info(snapshots.cells().shape(cell)).vertices; ++corner) {
    const bool beyond = snapshots.point(snapshot, cell, corner)[axis] > snapshots.centre()[axis];
    (beyond ? above : below) = true;
  }
  return below && above;
}

}  // namespace

std::vector<std::size_t> cells_cut_in_the_middle(const Snapshots& snapshots, std::size_t axis) {
  std::vector<std::size_t> cut;
  for (std::size_t cell = 0; cell < snapshots.cells().count(); ++cell)
    for (std::size_t s = 0; s < snapshots.count(); ++s)
      if (is_cut(snapshots, s, cell, axis)) {
        cut.push_back(cell);
        break;
      }
  return cut;
}

void pack_corners(const Snapshots& snapshots, const std::vector<std::size_t>& chosen, const std::string& name,
                  Packing* packing) {
  const Cells& cells = snapshots.cells();
  std::vector<std::int32_t> vertex_of(snapshots.mesh().node_count(), -1), corners;
  std::vector<std::vector<float>> places(snapshots.count());
  std::vector<std::uint8_t> shapes;
  std::vector<double> numbers;
  double last = 0;
  std::int32_t vertices = 0;
  for (const std::size_t c : chosen) {
    const int count = reference::info(cells.shape(c)).vertices;
    shapes.push_back(static_cast<std::uint8_t>(count));
    numbers.push_back(static_cast<double>(cells.number(c)) - last);
    last = static_cast<double>(cells.number(c));
    for (int corner = 0; corner < count; ++corner) {
      std::int32_t& vertex = vertex_of[static_cast<std::size_t>(cells.nodes(c)[static_cast<std::size_t>(corner)])];
      if (vertex < 0) {
        vertex = vertices++;
        for (std::size_t s = 0; s < snapshots.count(); ++s) {
          const auto place = snapshots.point(s, c, corner);
          for (std::size_t d = 0; d < 3; ++d) places[s].push_back(static_cast<float>(place[d] - snapshots.centre()[d]));
        }
      }
      corners.push_back(vertex);
    }
  }
  packing->add(name + "_shapes", shapes);
  packing->add(name + "_numbers", numbers);
  packing->add(name + "_corners", corners);
  for (std::size_t s = 0; s < snapshots.count(); ++s) {
    packing->add(name + "_vertices_" + Snapshots::name(s), places[s]);
    std::vector<std::uint8_t> js;
    for (const std::size_t c : chosen) js.push_back(as_byte(snapshots[s].scaled_jacobian[c]));
    packing->add(name + "_js_" + Snapshots::name(s), js);
  }
}

}  // namespace varimesh::client
