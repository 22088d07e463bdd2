#include "core/layers/walls.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <set>

#include "core/base/index.h"

namespace varimesh::detail {
namespace {

std::optional<int> number_of(const std::string& text) {
  int number = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), number);
  return fault == std::errc() && end == text.data() + text.size() ? std::optional(number) : std::nullopt;
}

/// What belongs to the wall of this name: a physical group, an entity, or everything.
struct Wall {
  std::optional<int> group, entity;
  bool is_all = false;

  bool has(const ElementBlock& block) const {
    if (is_all) return true;
    return group ? std::ranges::find(block.physical, *group) != block.physical.end() : entity == block.entity;
  }
};

std::string known_walls(const HighOrderMesh& mesh) {
  std::string names;
  for (const PhysicalGroup& group : mesh.physical_groups)
    if (group.dimension == mesh.dimension - 1)
      names += (names.empty() ? "" : ", ") + (group.name.empty() ? std::to_string(group.tag) : group.name);
  if (!names.empty()) return "The mesh has these groups of boundary elements: " + names + ".";
  std::set<int> tags;
  for (const ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == mesh.dimension - 1) tags.insert(block.entity);
  for (const int tag : tags) names += (names.empty() ? "" : ", ") + std::to_string(tag);
  return names.empty() ? "The mesh has no boundary elements; a wall is a group of them."
                       : "The boundary elements of the mesh have the tags " + names + ".";
}

Expected<Wall> find_wall(const HighOrderMesh& mesh, const std::string& name) {
  for (const PhysicalGroup& group : mesh.physical_groups)
    if (group.name == name && group.dimension == mesh.dimension - 1) return Wall{group.tag, {}};
  if (name == "all") return Wall{{}, {}, true};
  const std::optional<int> tag = number_of(name);
  Wall by_group{tag, {}}, by_entity{{}, tag};
  for (const Wall& wall : {by_group, by_entity})
    for (const ElementBlock& block : mesh.blocks)
      if (tag && reference::info(block.shape).dimension == mesh.dimension - 1 && wall.has(block)) return wall;
  for (const PhysicalGroup& group : mesh.physical_groups)
    if (group.name == name)
      return bad_option("The group '" + name + "' is no wall: its elements have dimension " +
                        std::to_string(group.dimension) + ", and the boundary has dimension " +
                        std::to_string(mesh.dimension - 1) + ". " + known_walls(mesh));
  return bad_option("There is no wall '" + name + "'. " + known_walls(mesh));
}

}  // namespace

Expected<std::vector<WallElement>> find_walls(const HighOrderMesh& mesh, const Facets& facets,
                                              std::span<const std::string> names) {
  std::vector<Wall> walls;
  for (const std::string& name : names) {
    const auto wall = find_wall(mesh, name);
    if (!wall) return tl::unexpected(wall.error());
    walls.push_back(*wall);
  }
  const Cells elements(mesh, mesh.dimension - 1);
  std::vector<WallElement> found;
  for (const auto& [facet, element] : facets.elements) {
    const ElementBlock& block = *elements.range_of(at(element)).block;
    if (std::ranges::none_of(walls, [&](const Wall& wall) { return wall.has(block); })) continue;
    if (facets.neighbour[at(facet)] >= 0) {
      const bool is_named =
          std::ranges::any_of(walls, [&](const Wall& wall) { return !wall.is_all && wall.has(block); });
      if (!is_named) continue;  // an interface is no part of the whole boundary
      return bad_input("Element " + std::to_string(elements.number(at(element))) +
                       " of the wall has cells on both sides. Layers can be made at the boundary only.");
    }
    found.push_back({facet, element});
  }
  if (found.empty()) return bad_option("The wall has no elements on the boundary of the cells.");
  return found;
}

}  // namespace varimesh::detail
