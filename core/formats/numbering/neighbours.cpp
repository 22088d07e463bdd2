#include "core/formats/numbering/neighbours.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <set>

#include "core/base/io/allowance.h"

namespace varimesh::formats {

namespace {

using Pairs = std::vector<std::pair<std::int32_t, std::int32_t>>;
using Corners = std::array<std::int32_t, 4>;

/// The image of a node; −1 if it has none.
std::int32_t image(const Pairs& pairs, std::int32_t node) {
  const auto found = std::lower_bound(pairs.begin(), pairs.end(), std::pair(node, std::int32_t(-1)));
  return found == pairs.end() || found->first != node ? -1 : found->second;
}

Pairs sorted(Pairs pairs) {
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

Pairs reversed(const Pairs& pairs) {
  Pairs back;
  for (const auto& [node, other] : pairs) back.emplace_back(other, node);
  return sorted(std::move(back));
}

/// A name that no group has: `plain`, or `plain` with "_2", "_3", … behind it.
std::string free_name(const std::vector<SideGroup>& groups, const std::string& plain) {
  const auto taken = [&](const std::string& name) {
    return std::any_of(groups.begin(), groups.end(), [&](const SideGroup& group) { return group.name == name; });
  };
  std::string name = plain;
  for (int k = 2; taken(name); ++k) name = plain + "_" + std::to_string(k);
  return name;
}

}  // namespace

Expected<void> check_two_at_sides(bool crowded, const char* format) {
  if (!crowded) return {};
  return bad_option(std::string(format) +
                    " format has no place for a side that more than two elements share; write msh41.");
}

Expected<void> check_two_at_sides(const HighOrderMesh& mesh, const Team& team, const char* format) {
  return check_two_at_sides(facets(mesh, team).crowded >= 0, format);
}

SideNeighbours::SideNeighbours(const HighOrderMesh& mesh, const Cells& cells, const Team& team)
    : mesh_(mesh), cells_(cells), facets_(facets(mesh, team)) {
  free_memory(facets_.first);
  free_memory(facets_.neighbour);
  std::size_t facet = 0;
  for (const Cells::Range& range : cells.ranges()) {
    runs_.push_back({range.first, facet, reference::info(range.block->shape).facets.size()});
    facet += range.block->size() * runs_.back().per_cell;
  }
  if (crowded()) return;
  find_groups();
  find_periodic();
  if (!image_.empty()) split_groups();
  for (std::size_t f = 0; f < side_count(); ++f)
    if (other_facet(f) < 0) groups_[std::size_t(group_of_facet_[f]) - 1].boundary = true;
}

std::size_t SideNeighbours::first_facet(std::size_t cell) const {
  const Run& run = *std::prev(
      std::upper_bound(runs_.begin(), runs_.end(), cell, [](std::size_t c, const Run& each) { return c < each.cell; }));
  return run.facet + (cell - run.cell) * run.per_cell;
}

std::int32_t SideNeighbours::corner(std::size_t cell, const CgnsSide& side, int k) const {
  return cells_.nodes(cell)[std::size_t(side.vertices[std::size_t(k)])];
}

const CgnsSide& SideNeighbours::side_of(std::size_t cell, std::size_t facet, int& number) const {
  const auto sides = cgns_sides(cells_.shape(cell));
  const int local = int(facet - first_facet(cell));
  number = 1;
  while (sides[std::size_t(number) - 1].facet != local) ++number;
  return sides[std::size_t(number) - 1];
}

void SideNeighbours::find_groups() {
  const Cells elements(mesh_, mesh_.dimension - 1);
  std::map<int, SideGroup> all;  // by tag
  for (const PhysicalGroup& group : mesh_.physical_groups)
    if (group.dimension == mesh_.dimension - 1 && group.tag != 0) all[std::abs(group.tag)].name = group.name;
  std::vector<std::int32_t>& tag_of = group_of_facet_;  // until the groups have numbers
  tag_of.assign(side_count(), 0);
  std::vector<bool> found_side(elements.count(), false);
  for (const auto& [facet, element] : facets_.elements) {
    found_side[std::size_t(element)] = true;
    const auto& physical = elements.range_of(std::size_t(element)).block->physical;
    if (physical.empty()) continue;
    const int tag = std::abs(physical.front());
    tag_of[std::size_t(facet)] = tag;
    const auto opposite = facets_.opposite[std::size_t(facet)];
    if (opposite >= 0) tag_of[std::size_t(opposite)] = tag;
  }
  stray_ = std::count(found_side.begin(), found_side.end(), false);
  std::set<int> outside;
  for (std::size_t f = 0; f < tag_of.size(); ++f) {
    if (tag_of[f] != 0) all[tag_of[f]].inner = true;
    if (!is_inside(f)) outside.insert(tag_of[f]);
  }
  for (const int tag : outside)
    if (tag != 0) all[tag].inner = false;
  const bool ungrouped = outside.contains(0);
  std::map<int, int> number;
  for (auto& [tag, group] : all) {
    group.tag = tag;
    if (group.name.empty()) group.name = "group_" + std::to_string(tag);
    groups_.push_back(group);
    number[tag] = int(groups_.size());
  }
  if (ungrouped) {
    groups_.push_back({0, free_name(groups_, "boundary"), 0, false, false});
    number[0] = int(groups_.size());
  }
  for (std::size_t f = 0; f < tag_of.size(); ++f)
    if (tag_of[f] != 0 || !is_inside(f)) group_of_facet_[f] = number[tag_of[f]];
}

void SideNeighbours::find_periodic() {
  std::map<Corners, std::size_t> by_corners;  // of the boundary
  const auto corners_of = [&](std::size_t facet, const Pairs* map) {
    const std::size_t cell = facet_cell(facet);
    int number = 0;
    const CgnsSide& side = side_of(cell, facet, number);
    Corners nodes{-1, -1, -1, -1};
    for (int k = 0; k < side.corners; ++k) {
      const std::int32_t node = corner(cell, side, k);
      nodes[std::size_t(k)] = map == nullptr ? node : image(*map, node);
      if (nodes[std::size_t(k)] < 0) return Corners{-1, -1, -1, -1};
    }
    std::sort(nodes.begin(), nodes.end());
    return nodes;
  };
  for (const PeriodicLink& link : mesh_.periodic) {
    if (link.dimension != mesh_.dimension - 1) continue;
    if (image_.empty()) {
      image_.assign(side_count(), -1);
      image_link_.assign(side_count(), 0);
    }
    if (by_corners.empty())
      for (std::size_t f = 0; f < side_count(); ++f)
        if (!is_inside(f)) by_corners[corners_of(f, nullptr)] = f;
    there_.push_back(sorted(link.nodes));
    back_.push_back(reversed(link.nodes));
    const auto number = std::int32_t(there_.size());
    for (const auto& [corners, f] : by_corners) {
      if (image_[f] >= 0) continue;
      const Corners wanted = corners_of(f, &there_.back());
      const auto found = by_corners.find(wanted);
      if (wanted[3] < 0 || found == by_corners.end() || found->second == f || image_[found->second] >= 0) continue;
      image_[f] = std::int64_t(found->second);
      image_[found->second] = std::int64_t(f);
      image_link_[f] = number;
      image_link_[found->second] = -number;
    }
  }
}

/// Sorts the sides of each group by their periodic link. Sides without a link keep the group. If all sides of a group
/// are the same side of one link, the group becomes periodic; otherwise each side of a link gets a group.
void SideNeighbours::split_groups() {
  std::map<int, std::map<int, int>> parts;  // by group and periodic number: the group of these sides
  std::vector<bool> outside(groups_.size() + 1, false);
  for (std::size_t f = 0; f < side_count(); ++f) {
    const int group = group_of_facet_[f];
    if (group == 0) continue;
    parts[group][-image_link_[f]] = group;
    if (!is_inside(f) && image_link_[f] == 0) outside[std::size_t(group)] = true;
  }
  for (auto& [group, numbers] : parts) {
    if (numbers.size() == 1) {
      groups_[std::size_t(group) - 1].periodic = numbers.begin()->first;
      continue;
    }
    const std::string name = groups_[std::size_t(group) - 1].name + "_periodic_";
    groups_[std::size_t(group) - 1].inner = !outside[std::size_t(group)];
    bool unused = !numbers.contains(0);  // the old group, so that the first part takes its place
    for (auto& [number, part] : numbers) {
      if (number == 0) continue;
      const std::string own = name + std::to_string(std::abs(number)) + (number < 0 ? "_first" : "_second");
      SideGroup periodic{0, free_name(groups_, own), number, false, false};
      if (unused) {
        groups_[std::size_t(group) - 1] = std::move(periodic);
        unused = false;
      } else {
        groups_.push_back(std::move(periodic));
        part = int(groups_.size());
      }
    }
  }
  for (std::size_t f = 0; f < side_count(); ++f)
    if (group_of_facet_[f] != 0) group_of_facet_[f] = parts[group_of_facet_[f]][-image_link_[f]];
}

SideNeighbour SideNeighbours::of(std::size_t cell, const CgnsSide& side) const {
  SideNeighbour other;
  other.own_facet = first_facet(cell) + std::size_t(side.facet);
  other.group = group_of_facet_[other.own_facet];
  const bool inside = is_inside(other.own_facet);
  const std::int64_t opposite = other_facet(other.own_facet);
  if (opposite < 0) return other;
  other.facet = std::size_t(opposite);
  other.cell = std::int64_t(facet_cell(other.facet));
  const CgnsSide& its = side_of(std::size_t(other.cell), other.facet, other.side);
  std::int32_t first = corner(cell, side, 0);
  if (!inside) {
    const std::int32_t link = image_link_[other.own_facet];
    first = image(link > 0 ? there_[std::size_t(link) - 1] : back_[std::size_t(-link) - 1], first);
  }
  for (int k = 0; k < its.corners; ++k)
    if (corner(std::size_t(other.cell), its, k) == first) other.flip = k + 1;
  return other;
}

}  // namespace varimesh::formats
