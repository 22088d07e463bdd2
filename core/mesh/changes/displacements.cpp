// Reads lists of displacements, and checks every boundary node before the mesh is changed.
#include "core/mesh/changes/displacements.h"

#include <cmath>
#include <optional>
#include <string>
#include <unordered_map>

#include "core/base/io/text_lines.h"
#include "core/mesh/connectivity.h"
#include "core/mesh/node_parameters.h"

namespace varimesh {
namespace {

// === Text ================================================================================================

// The displacement that a line contains, if it is well-formed.
std::optional<NodeDisplacement> parse_line(std::string_view line, int dimension) {
  NodeDisplacement displacement;
  if (!parse(next_word(line), displacement.number)) return std::nullopt;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::string_view word = next_word(line);
    if (k == 2 && dimension == 2 && word.empty()) break;
    if (!parse(word, displacement.by[k])) return std::nullopt;
  }
  if (!next_word(line).empty()) return std::nullopt;
  return displacement;
}

// === Boundary nodes ======================================================================================

// The index of each boundary node by its number. Inner nodes have −1 − index, to distinguish them from unknown nodes.
std::unordered_map<std::int64_t, std::int64_t> number_boundary(const HighOrderMesh& mesh) {
  const std::vector<bool> fixed = fixed_nodes(mesh);
  std::unordered_map<std::int64_t, std::int64_t> index;
  index.reserve(mesh.node_count());
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    index.emplace(mesh.node_numbers[n], fixed[n] ? std::int64_t(n) : -1 - std::int64_t(n));
  return index;
}

Expected<std::size_t> find_boundary_node(const std::unordered_map<std::int64_t, std::int64_t>& index,
                                         std::int64_t number, const char* source) {
  const auto found = index.find(number);
  if (found == index.end())
    return bad_input(std::string(source) + " names node " + std::to_string(number) +
                     ", which the mesh does not have; use the node numbers of the mesh.");
  if (found->second < 0)
    return bad_input(std::string(source) + " names node " + std::to_string(number) +
                     ", which is inside the mesh; move only nodes on the boundary.");
  return std::size_t(found->second);
}

}  // namespace

Expected<std::vector<NodeDisplacement>> read_displacements(std::string_view text, int dimension) {
  std::vector<NodeDisplacement> displacements;
  std::string_view line;
  for (std::size_t number = 0; next_line(text, line, number);) {
    const auto displacement = parse_line(line, dimension);
    if (!displacement)
      return bad_input(
          "Line " + std::to_string(number) + " of the displacements is not a node number and " +
          (dimension == 2 ? "two or three numbers; write 'number dx dy'" : "three numbers; write 'number dx dy dz'") +
          " for each node.");
    displacements.push_back(*displacement);
  }
  if (displacements.empty())
    return bad_input("The list of displacements is empty; write a line 'number dx dy dz' for each node that moves.");
  return displacements;
}

Expected<void> displace_boundary(HighOrderMesh& mesh, std::span<const NodeDisplacement> displacements) {
  const auto index = number_boundary(mesh);
  std::vector<bool> moved(mesh.node_count(), false);
  std::vector<double> coordinates = mesh.coordinates;
  for (const NodeDisplacement& displacement : displacements) {
    const auto node = find_boundary_node(index, displacement.number, "The list of displacements");
    if (!node) return tl::unexpected(node.error());
    const std::string name = "node " + std::to_string(displacement.number);
    if (moved[*node]) return bad_input("The list of displacements names " + name + " twice; name each node once.");
    moved[*node] = true;
    if (mesh.dimension == 2 && displacement.by[2] != 0)
      return bad_input("The displacement of " + name + " has a dz of " + std::to_string(displacement.by[2]) +
                       ", which would move it out of the plane of the 2-D mesh; give only dx and dy.");
    for (std::size_t k = 0; k < 3; ++k) {
      if (!std::isfinite(displacement.by[k]))
        return bad_input("The displacement of " + name + " is not a finite number; correct the list.");
      coordinates[3 * *node + k] += displacement.by[k];
    }
  }
  const NodesWithParameters before(mesh);
  mesh.coordinates = std::move(coordinates);
  before.forget_moved(mesh);
  return {};
}

Expected<void> replace_boundary(HighOrderMesh& mesh, const HighOrderMesh& boundary) {
  const auto index = number_boundary(mesh);
  std::vector<bool> used(boundary.node_count(), false);
  for (const ElementBlock& block : boundary.blocks)
    for (const std::int32_t node : block.nodes) used[std::size_t(node)] = true;
  std::vector<double> coordinates = mesh.coordinates;
  bool any = false;
  for (std::size_t n = 0; n < boundary.node_count(); ++n) {
    if (!used[n]) continue;
    any = true;
    const auto node = find_boundary_node(index, boundary.node_numbers[n], "The mesh of the boundary");
    if (!node) return tl::unexpected(node.error());
    for (std::size_t k = 0; k < 3; ++k) {
      const double x = boundary.coordinates[3 * n + k];
      if (!std::isfinite(x))
        return bad_input("Node " + std::to_string(boundary.node_numbers[n]) +
                         " of the mesh of the boundary has a coordinate that is not a finite number; write that mesh "
                         "again.");
      coordinates[3 * *node + k] = x;
    }
  }
  if (!any) return bad_input("The mesh of the boundary has no elements; save its lines (2-D) or faces (3-D) too.");
  const NodesWithParameters before(mesh);
  mesh.coordinates = std::move(coordinates);
  before.forget_moved(mesh);
  return {};
}

}  // namespace varimesh
