#include "server/engine/output_check.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "core/formats/formats.h"
#include "core/mesh/changes/change_order.h"
#include "core/reference/nodes.h"
#include "server/engine/translate.h"

namespace varimesh::server {
namespace {

/// A mesh with one straight cell of each shape and order. It has nothing of the places of nodes, which a run changes.
HighOrderMesh one_cell_of_each(const HighOrderMesh& mesh) {
  HighOrderMesh sample;
  sample.dimension = mesh.dimension;
  sample.order = mesh.order;
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != mesh.dimension || block.size() == 0) continue;
    const auto is_alike = [&](const ElementBlock& other) {
      return other.shape == block.shape && other.order == block.order;
    };
    if (std::ranges::any_of(sample.blocks, is_alike)) continue;
    ElementBlock cell;
    cell.shape = block.shape;
    cell.order = block.order;
    cell.entity = block.entity;
    cell.numbers = {block.numbers.front()};
    for (const std::array<std::int8_t, 3>& place : reference::lattice(block.shape, block.order)) {
      const auto node = static_cast<std::int32_t>(sample.node_count());
      cell.nodes.push_back(node);
      sample.node_numbers.push_back(node + 1);
      for (const std::int8_t x : place) sample.coordinates.push_back(double(x) / block.order);
    }
    sample.blocks.push_back(std::move(cell));
  }
  sample.node_blocks = {{-1, 0, 0, static_cast<std::int32_t>(sample.node_count())}};
  return sample;
}

bool is_mesh_file(v1::MeshFormat format) {
  return format != v1::MESH_FORMAT_PARTS && format != v1::MESH_FORMAT_CELL_QUALITY;
}

}  // namespace

Expected<void> check_outputs_can_hold(const HighOrderMesh& mesh, int order, std::span<const v1::MeshFormat> formats,
                                      int threads) {
  if (std::ranges::none_of(formats, is_mesh_file)) return {};
  HighOrderMesh sample = one_cell_of_each(mesh);
  if (order > 0 && order != mesh.order) {
    auto changed = change_order(sample, order);
    if (!changed) return {};  // The run itself says why.
    sample = std::move(*changed);
  }
  // A mesh of another order gets new nodes, which neighbours share.
  const bool looks_at_sides = order <= 0 || order == mesh.order;
  for (const v1::MeshFormat format : formats) {
    if (!is_mesh_file(format)) continue;
    const auto written = formats::write(sample, format_from(format), [](std::string_view) { return true; });
    // What else a writer may refuse depends on more than shapes and orders.
    if (!written && written.error().kind == Error::Kind::BadOption) return written;
    if (!looks_at_sides) continue;
    if (auto shared = formats::check_sides(mesh, format_from(format), threads); !shared) return shared;
  }
  return {};
}

}  // namespace varimesh::server
