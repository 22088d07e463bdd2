#include "core/formats/reordering.h"

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "core/formats/common/reading_notes.h"
#include "core/formats/numbering/node_order.h"
#include "core/mesh/changes/serendipity_elements.h"
#include "core/mesh/check.h"

namespace varimesh::formats {

namespace {

constexpr std::array kOrders = {NodeOrder::Gmsh, NodeOrder::Vtk, NodeOrder::Cgns, NodeOrder::Exodus, NodeOrder::Abaqus};

std::string_view name_of(NodeOrder order) {
  for (const NodeOrderEntry& entry : node_orders())
    if (entry.order == order) return entry.name;
  return {};
}

bool is_msh(Format format) {
  return format == Format::Msh22 || format == Format::Msh22Binary || format == Format::Msh41 ||
         format == Format::Msh41Binary;
}

/// VTK has no pyramids of order 2 and above.
bool has_order(const HighOrderMesh& mesh, NodeOrder order) {
  return order != NodeOrder::Vtk || std::ranges::none_of(mesh.blocks, [](const ElementBlock& block) {
           return block.shape == Shape::Pyramid && block.order > 1 && block.size() > 0;
         });
}

void reorder(ElementBlock& block, NodeOrder order) {
  if (block.shape == Shape::Point || block.order < 2) return;
  const std::vector<int>& place = gmsh_nodes(order, block.shape, block.order);
  const std::size_t stride = nodes_per_element(block);
  std::vector<std::int32_t> file(stride);
  for (std::size_t e = 0; e < block.size(); ++e) {
    std::int32_t* nodes = block.nodes.data() + e * stride;
    std::copy_n(nodes, stride, file.begin());
    // The first nodes of complete elements, which serendipity elements have, are the first in all of these orders.
    for (std::size_t i = 0; i < stride; ++i) nodes[std::size_t(place[i])] = file[i];
  }
}

/// The mesh as the file has it, in another order. Nothing if it came with elements that became complete and no longer
/// are what they were.
std::optional<HighOrderMesh> reordered(const HighOrderMesh& mesh, NodeOrder order) {
  const std::vector<Shape> came = serendipity_of(mesh);
  std::optional<HighOrderMesh> made = came.empty() ? std::optional(mesh) : as_serendipity(mesh, came);
  if (!made) return std::nullopt;
  for (ElementBlock& block : made->blocks) reorder(block, order);
  if (came.empty()) return made;
  constexpr std::int64_t kUnlimited = std::int64_t{1} << 56;
  Allowance allowance(kUnlimited);
  if (!complete_elements(*made, allowance)) return std::nullopt;
  return made;
}

}  // namespace

Expected<void> take_node_order(HighOrderMesh& mesh, Format read_as, std::string_view name) {
  const auto* order = std::ranges::find_if(kOrders, [&](NodeOrder each) { return name_of(each) == name; });
  if (order == kOrders.end())
    return bad_option("There is no order of nodes '" + std::string(name) +
                      "'; the orders are gmsh, vtk, cgns, exodus and abaqus.");
  if (!is_msh(read_as))
    return bad_option("node_order is for MSH files. The order of the nodes of a file of format " +
                      std::string(format_name(read_as)) + " is known.");
  if (!has_order(mesh, *order)) return bad_option("VTK has no order for pyramids of order 2 and above.");
  std::optional<HighOrderMesh> made = reordered(mesh, *order);
  if (!made) return bad_option("The nodes of this mesh cannot be put into another order.");
  mesh = std::move(*made);
  return {};
}

std::vector<std::string> fitting_node_orders(const HighOrderMesh& mesh, Format read_as) {
  if (!is_msh(read_as) || check_structure(mesh)) return {};
  std::vector<std::string> fitting;
  for (const NodeOrder order : kOrders) {
    if (order == NodeOrder::Gmsh || !has_order(mesh, order)) continue;
    const std::optional<HighOrderMesh> made = reordered(mesh, order);
    if (made && check_structure(*made)) fitting.emplace_back(name_of(order));
  }
  return fitting;
}

}  // namespace varimesh::formats
