// Goes through fixed vertices, through cells that fixed faces close in, and through fixed faces.
#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <utility>

#include "core/base/index.h"
#include "core/diagnosis/diagnose.h"
#include "core/diagnosis/fixed_samples.h"
#include "core/diagnosis/vertex_corners.h"
#include "core/diagnosis/vertex_link.h"
#include "core/mesh/connectivity.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

using detail::Vector;
using Kind = UnrepairableGroup::Kind;

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

/// "tetrahedron 4711", or "tetrahedra 12, 13 and 20 more" for many.
std::string elements_text(const Cells& cells, const UnrepairableGroup& group) {
  const reference::ShapeInfo& shape = reference::info(cells.shape(at(group.cells.front())));
  bool mixed = false;
  for (const std::int32_t cell : group.cells) mixed |= cells.shape(at(cell)) != shape.shape;
  const std::size_t count = group.elements.size(), shown = std::min<std::size_t>(count, 8);
  std::string text(mixed ? "elements" : count == 1 ? shape.name : shape.plural);
  for (std::size_t i = 0; i < shown; ++i)
    text += (i == 0 ? " " : i + 1 == count ? " and " : ", ") + std::to_string(group.elements[i]);
  if (count > shown) text += " and " + std::to_string(count - shown) + " more";
  return text;
}

void add_cell(const Cells& cells, std::int32_t cell, UnrepairableGroup& group) {
  group.cells.push_back(cell);
  group.elements.push_back(cells.number(at(cell)));
}

/// Runs make(i, out) for every i and puts what comes of it in order.
template <class Make>
std::vector<UnrepairableGroup> gather(const Team& team, std::size_t count, Make&& make) {
  constexpr std::size_t kChunk = 256;
  std::vector<std::vector<UnrepairableGroup>> parts((count + kChunk - 1) / kChunk);
  team.for_each(static_cast<std::int32_t>(parts.size()), 1, [&](std::int32_t part) {
    const std::size_t first = at(part) * kChunk;
    for (std::size_t i = first; i < std::min(count, first + kChunk); ++i) make(i, parts[at(part)]);
  });
  std::vector<UnrepairableGroup> result;
  for (auto& part : parts) std::ranges::move(part, std::back_inserter(result));
  return result;
}

// ---------------------------------------------------------------------------------------------------------------------
// At vertices
// ---------------------------------------------------------------------------------------------------------------------

UnrepairableGroup vertex_group(const HighOrderMesh& mesh, const Cells& cells, std::int32_t node,
                               const detail::VertexCorners::Link& link, const detail::LinkFault& fault) {
  UnrepairableGroup group;
  const bool fan = fault.free_direction >= 0;
  group.kind = fan ? Kind::Fan : fault.corners.size() == 1 ? Kind::Vertex : Kind::VertexGroup;
  group.vertex = mesh.node_numbers[at(node)];
  group.place = position(mesh, node);
  group.determinant = fault.determinant;
  for (const std::int32_t corner : fault.corners) add_cell(cells, link.corners[at(corner)].cell, group);
  const std::string node_text = "node " + std::to_string(group.vertex) + " " + place_text(group.place);
  const std::string det_text = number_text(fault.determinant);
  const char* name = group.elements.size() == 1 ? reference::info(cells.shape(at(group.cells[0]))).name.data() : "";
  std::string text = elements_text(cells, group);
  if (fan) {
    text += (group.elements.size() == 1 ? " has" : " share") + std::string(" the edge from ") + node_text +
            " to node " + std::to_string(mesh.node_numbers[at(link.ends[at(fault.free_direction)])]) +
            ", which whatever its direction is on the wrong side of fixed edges there (margin " + det_text +
            "); the boundary must be refined or an interior edge opposite split there.";
  } else if (group.kind == Kind::Vertex) {
    text +=
        std::abs(fault.determinant) < 0.1
            ? ": its three edges at " + node_text + " lie in the surface's tangent plane (determinant " + det_text + ")"
            : ": its three edges at " + node_text + " are fixed and the wrong way round (determinant " + det_text + ")";
    text += "; the boundary must be refined or the " + std::string(name) + " split there.";
  } else if (fault.room == 0) {
    text += " are fenced in at " + node_text + " by three fixed edges that lie in one plane (determinant " + det_text +
            "); the boundary must be refined or an interior edge of the fence split there.";
  } else {
    text += " are fenced in at " + node_text + " by fixed edges (determinant " + det_text +
            "); they would have to fill a solid angle of " + number_text(fault.angle) + ", and the boundary leaves " +
            number_text(fault.room) + " for all; it must be refined or an interior edge of the fence split there.";
  }
  group.sentence = std::move(text);
  return group;
}

std::vector<UnrepairableGroup> at_vertices(const HighOrderMesh& mesh, const Cells& cells,
                                           const std::vector<bool>& fixed, double sign, const Team& team) {
  const detail::VertexCorners corners(mesh, cells, fixed, sign);
  return gather(team, corners.vertices(), [&](std::size_t i, std::vector<UnrepairableGroup>& out) {
    const detail::VertexCorners::Link link = corners.link(i);
    for (const detail::LinkFault& fault : detail::link_faults(link.directions, link.corners))
      out.push_back(vertex_group(mesh, cells, link.node, link, fault));
  });
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
  std::string text = elements_text(cells, group);
  if (sample.dimension == 0) {
    group.vertex = mesh.node_numbers[at(cells.nodes(at(cell))[at(sample.vertex)])];
    text +=
        ": its two edges at node " + std::to_string(group.vertex) + " " + place_text(group.place) + " are fixed and";
  } else if (sample.dimension == 1) {
    text += ": its two fixed faces meet along an edge, and at " + place_text(group.place) + " they";
  } else {
    text += ": at " + place_text(group.place) + " all nodes that decide are fixed and";
  }
  text += " leave it no room (J is " + number_text(group.determinant) +
          " of its largest there); the boundary must be refined or the " +
          std::string(reference::info(cells.shape(at(cell))).name) + " split there.";
  group.sentence = std::move(text);
  return group;
}

std::vector<UnrepairableGroup> between_faces(const HighOrderMesh& mesh, const Cells& cells,
                                             const std::vector<bool>& fixed, double sign, const Team& team) {
  const detail::FixedSamples samples(mesh, cells);
  return gather(team, cells.count(), [&](std::size_t cell, std::vector<UnrepairableGroup>& out) {
    for (const detail::FixedSample& sample : samples.worst(cell, fixed, sign))
      out.push_back(sample_group(mesh, cells, static_cast<std::int32_t>(cell), sample));
  });
}

std::vector<UnrepairableGroup> folded_faces(const HighOrderMesh& mesh, const Cells& cells,
                                            const std::vector<bool>& fixed, const Team& team) {
  const detail::FoldedFacets folded(mesh, cells);
  return gather(team, cells.count(), [&](std::size_t cell, std::vector<UnrepairableGroup>& out) {
    for (const detail::FixedSample& sample : folded.in(cell, fixed)) {
      UnrepairableGroup group;
      add_cell(cells, static_cast<std::int32_t>(cell), group);
      group.kind = Kind::FoldedFace;
      group.place = sample.place;
      group.determinant = sample.jacobian;
      const bool plane = mesh.dimension == 2;
      group.sentence = elements_text(cells, group) + ": its fixed " + (plane ? "straight edge" : "flat face") +
                       " folds over itself at " + place_text(group.place) + " (" +
                       (plane ? "its tangent" : "its normal") +
                       " changes sign); the boundary must be meshed anew or refined there.";
      out.push_back(std::move(group));
    }
  });
}

}  // namespace

std::vector<UnrepairableGroup> diagnose(const HighOrderMesh& mesh, const std::vector<bool>& fixed, const Team& team) {
  assert(fixed.size() == mesh.node_count());
  const Cells cells(mesh, mesh.dimension);
  const double sign = detail::orientation(mesh);
  std::vector<UnrepairableGroup> groups;
  if (mesh.dimension == 3) groups = at_vertices(mesh, cells, fixed, sign, team);
  std::ranges::move(between_faces(mesh, cells, fixed, sign, team), std::back_inserter(groups));
  std::ranges::move(folded_faces(mesh, cells, fixed, team), std::back_inserter(groups));
  return groups;
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

std::vector<UnrepairableGroup> diagnose(const HighOrderMesh& mesh, int threads) {
  const std::vector<bool> fixed = fixed_nodes(mesh);
  const Team team(threads);
  std::vector<UnrepairableGroup> groups;
  team.run([&] { groups = diagnose(mesh, fixed, team); });
  return groups;
}

}  // namespace varimesh
