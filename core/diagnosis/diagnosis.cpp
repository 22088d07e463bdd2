// Examines fixed vertices, cells between fixed faces, and fixed faces.
#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <unordered_set>
#include <utility>

#include "core/base/index.h"
#include "core/diagnosis/diagnose.h"
#include "core/diagnosis/elements_text.h"
#include "core/diagnosis/fixed_samples.h"
#include "core/diagnosis/gather.h"
#include "core/diagnosis/vertex_corners.h"
#include "core/diagnosis/vertex_link.h"
#include "core/mesh/check.h"
#include "core/mesh/connectivity.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

using detail::Vector;
using Kind = UnrepairableGroup::Kind;

constexpr std::size_t kChunk = 256;  // vertices or cells that a task takes at a time

Vector position(const HighOrderMesh& mesh, std::int32_t node) {
  const double* x = mesh.coordinates.data() + 3 * at(node);
  return {x[0], x[1], x[2]};
}

std::string number_text(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", x);
  return text;
}

std::string place_text(const Vector& p) {
  return "(" + number_text(p[0]) + ", " + number_text(p[1]) + ", " + number_text(p[2]) + ")";
}

/// The group's elements, by the name of their shape if they share one.
std::string names_of(const Cells& cells, const UnrepairableGroup& group) {
  const reference::ShapeInfo& shape = reference::info(cells.shape(at(group.cells.front())));
  bool mixed = false;
  for (const std::int32_t cell : group.cells) mixed |= cells.shape(at(cell)) != shape.shape;
  return mixed ? elements_text(group.elements, "elements", "elements")
               : elements_text(group.elements, shape.name, shape.plural);
}

void add_cell(const Cells& cells, std::int32_t cell, UnrepairableGroup& group) {
  group.cells.push_back(cell);
  group.elements.push_back(cells.number(at(cell)));
}

// ---------------------------------------------------------------------------------------------------------------------
// At vertices
// ---------------------------------------------------------------------------------------------------------------------

/// The sentence about a group at a vertex.
std::string vertex_sentence(const HighOrderMesh& mesh, const Cells& cells, const UnrepairableGroup& group,
                            const detail::VertexCorners::Link& link, const detail::LinkFault& fault) {
  const std::string node = "node " + std::to_string(group.vertex) + " " + place_text(group.place);
  const std::string determinant = number_text(fault.determinant);
  const bool single = group.elements.size() == 1;
  const std::string names = names_of(cells, group);
  if (group.kind == Kind::Fan)
    return names + (single ? " has" : " share") + " the edge from " + node + " to node " +
           std::to_string(mesh.node_numbers[at(link.ends[at(fault.free_direction)])]) +
           ", which is on the wrong side of fixed edges there whatever its direction (margin " + determinant +
           "); refine the boundary there, or split an interior edge opposite.";
  if (group.kind == Kind::Vertex)
    return names + ": its three edges at " + node +
           (std::abs(fault.determinant) < 0.1 ? " lie in the surface's tangent plane"
                                              : " are fixed and the wrong way round") +
           " (determinant " + determinant + "); refine the boundary there, or split the " +
           std::string(reference::info(cells.shape(at(group.cells[0]))).name) + ".";
  if (fault.room == 0)
    return names + " are enclosed at " + node + " by three fixed edges that lie in one plane (determinant " +
           determinant + "); refine the boundary there, or split an interior edge between the ends of two of them.";
  return names + " are enclosed at " + node + " by fixed edges (determinant " + determinant +
         "); they would have to fill a solid angle of " + number_text(fault.angle) + ", and the boundary leaves " +
         number_text(fault.room) +
         " for all; refine the boundary there, or split an interior edge between the ends of two of the fixed edges.";
}

UnrepairableGroup vertex_group(const HighOrderMesh& mesh, const Cells& cells, const detail::VertexCorners::Link& link,
                               const detail::LinkFault& fault) {
  UnrepairableGroup group;
  group.kind = fault.free_direction >= 0 ? Kind::Fan : fault.corners.size() == 1 ? Kind::Vertex : Kind::VertexGroup;
  group.vertex = mesh.node_numbers[at(link.node)];
  group.place = position(mesh, link.node);
  group.determinant = fault.determinant;
  for (const std::int32_t corner : fault.corners) add_cell(cells, link.corners[at(corner)].cell, group);
  group.sentence = vertex_sentence(mesh, cells, group, link, fault);
  return group;
}

std::vector<UnrepairableGroup> at_vertices(const HighOrderMesh& mesh, const Cells& cells,
                                           const std::vector<bool>& fixed, double sign, const Team& team) {
  const detail::VertexCorners corners(mesh, cells, fixed, sign);
  std::vector<UnrepairableGroup> groups;
  detail::gather(team, corners.vertices(), kChunk, groups, [&](std::size_t i, std::vector<UnrepairableGroup>& out) {
    const detail::VertexCorners::Link link = corners.link(i);
    for (const detail::LinkFault& fault : detail::link_faults(link.directions, link.corners))
      out.push_back(vertex_group(mesh, cells, link, fault));
  });
  return groups;
}

// ---------------------------------------------------------------------------------------------------------------------
// On edges and faces, and inside
// ---------------------------------------------------------------------------------------------------------------------

UnrepairableGroup sample_group(const HighOrderMesh& mesh, const Cells& cells, std::int32_t cell,
                               const detail::FixedSample& sample) {
  UnrepairableGroup group;
  add_cell(cells, cell, group);
  group.place = sample.place;
  group.determinant = sample.jacobian;
  group.kind = sample.dimension == 0 ? Kind::Vertex : sample.dimension == 1 ? Kind::Edge : Kind::Face;
  std::string text = names_of(cells, group);
  if (sample.dimension == 0) {
    group.vertex = mesh.node_numbers[at(cells.nodes(at(cell))[at(sample.vertex)])];
    text += ": its two edges at node " + std::to_string(group.vertex) + " " + place_text(group.place) +
            " are fixed and leave it no room";
  } else if (sample.dimension == 1) {
    text += ": its two fixed faces meet along an edge and leave it no room at " + place_text(group.place);
  } else {
    text += ": J at " + place_text(group.place) + " depends on fixed nodes only, which leave it no room";
  }
  text += " (J there is " + number_text(group.determinant) +
          " of its largest value); refine the boundary there, or split the " +
          std::string(reference::info(cells.shape(at(cell))).name) + ".";
  group.sentence = std::move(text);
  return group;
}

std::vector<UnrepairableGroup> between_faces(const HighOrderMesh& mesh, const Cells& cells,
                                             const std::vector<bool>& fixed, double sign, const Team& team) {
  const detail::FixedSamples samples(mesh, cells);
  std::vector<UnrepairableGroup> groups;
  detail::gather(team, cells.count(), kChunk, groups, [&](std::size_t cell, std::vector<UnrepairableGroup>& out) {
    for (const detail::FixedSample& sample : samples.worst(cell, fixed, sign, team.stop()))
      out.push_back(sample_group(mesh, cells, static_cast<std::int32_t>(cell), sample));
  });
  return groups;
}

std::vector<UnrepairableGroup> folded_faces(const HighOrderMesh& mesh, const Cells& cells,
                                            const std::vector<bool>& fixed, const Team& team) {
  const detail::FoldedFacets folded(mesh, cells);
  std::vector<UnrepairableGroup> groups;
  detail::gather(team, cells.count(), kChunk, groups, [&](std::size_t cell, std::vector<UnrepairableGroup>& out) {
    for (const detail::FixedSample& sample : folded.in(cell, fixed)) {
      UnrepairableGroup group;
      add_cell(cells, static_cast<std::int32_t>(cell), group);
      group.kind = Kind::FoldedFace;
      group.place = sample.place;
      group.determinant = sample.jacobian;
      const bool plane = mesh.dimension == 2;
      if (sample.is_curved) {
        group.sentence = names_of(cells, group) + ": its fixed face turns by more than 90° within itself at " +
                         place_text(group.place) + " and leaves hardly any room (" + number_text(sample.jacobian) +
                         "; a flat face leaves 1); mesh the boundary anew there, or refine it.";
        out.push_back(std::move(group));
        continue;
      }
      group.sentence = names_of(cells, group) + ": its fixed " + (plane ? "straight edge" : "flat face") +
                       " folds over itself at " + place_text(group.place) + " (" +
                       (plane ? "its tangent" : "its normal") +
                       " changes sign); mesh the boundary anew there, or refine it.";
      out.push_back(std::move(group));
    }
  });
  return groups;
}

}  // namespace

std::vector<UnrepairableGroup> diagnose(const HighOrderMesh& mesh, const std::vector<bool>& fixed, const Team& team) {
  assert(fixed.size() == mesh.node_count());
  const Cells cells(mesh, mesh.dimension);
  const double sign = detail::orientation(mesh, team);
  std::vector<UnrepairableGroup> groups;
  if (mesh.dimension == 3) groups = at_vertices(mesh, cells, fixed, sign, team);
  std::ranges::move(between_faces(mesh, cells, fixed, sign, team), std::back_inserter(groups));
  std::ranges::move(folded_faces(mesh, cells, fixed, team), std::back_inserter(groups));
  return groups;
}

std::vector<char> cells_beyond_repair(std::span<const UnrepairableGroup> groups, std::size_t cells) {
  std::vector<char> result(cells, 0);
  for (const UnrepairableGroup& group : groups)
    if (is_proved(group) || group.kind == UnrepairableGroup::Kind::VertexGroup)
      for (const std::int32_t cell : group.cells) result[static_cast<std::size_t>(cell)] = 1;
  return result;
}

std::vector<UnrepairableGroup> with_any_of(std::vector<UnrepairableGroup> groups,
                                           const std::vector<std::int64_t>& numbers) {
  std::vector<std::int64_t> sorted = numbers;
  std::ranges::sort(sorted);
  std::erase_if(groups, [&](const UnrepairableGroup& group) {
    return std::ranges::none_of(group.elements,
                                [&](std::int64_t element) { return std::ranges::binary_search(sorted, element); });
  });
  return groups;
}

std::size_t least_invalid(const std::vector<UnrepairableGroup>& groups) {
  std::vector<const UnrepairableGroup*> smallest_first;
  for (const UnrepairableGroup& group : groups) smallest_first.push_back(&group);
  std::ranges::stable_sort(smallest_first, {}, [](const UnrepairableGroup* group) { return group->cells.size(); });
  std::unordered_set<std::int32_t> taken;
  std::size_t count = 0;
  for (const UnrepairableGroup* group : smallest_first) {
    if (std::ranges::any_of(group->cells, [&](std::int32_t cell) { return taken.contains(cell); })) continue;
    taken.insert(group->cells.begin(), group->cells.end());
    ++count;
  }
  return count;
}

std::vector<UnrepairableGroup> diagnose(const HighOrderMesh& mesh, int threads) {
  return diagnose(mesh, Team(threads));
}

std::vector<UnrepairableGroup> diagnose(const HighOrderMesh& mesh, const Team& team) {
  if (is_surface(mesh)) return {};
  const std::vector<bool> fixed = fixed_nodes(mesh);
  std::vector<UnrepairableGroup> groups;
  team.run([&] { groups = diagnose(detail::OrientedMesh(mesh, team).mesh(), fixed, team); });
  return groups;
}

}  // namespace varimesh
