// The corners of all cells of a large 3-D mesh, from which the page draws the elements that a cut goes through.
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

}  // namespace

void pack_corners(const Snapshots& snapshots, Packing* packing) {
  const Cells& cells = snapshots.cells();
  std::vector<std::int32_t> vertex_of(snapshots.mesh().node_count(), -1), corners;
  std::vector<std::vector<float>> places(snapshots.count());
  std::vector<std::uint8_t> shapes;
  std::vector<double> numbers;
  double last = 0;
  std::int32_t vertices = 0;
  for (std::size_t c = 0; c < cells.count(); ++c) {
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
  packing->add("all_shapes", shapes);
  packing->add("all_numbers", numbers);
  packing->add("all_corners", corners);
  for (std::size_t s = 0; s < snapshots.count(); ++s) {
    packing->add(std::string("all_vertices_") + Snapshots::name(s), places[s]);
    std::vector<std::uint8_t> js;
    for (const double value : snapshots[s].scaled_jacobian) js.push_back(as_byte(value));
    packing->add(std::string("all_js_") + Snapshots::name(s), js);
  }
}

}  // namespace varimesh::client
