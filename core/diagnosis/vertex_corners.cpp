// Sorts corners by vertex, and computes tangents of mesh edges at their ends.
#include "core/diagnosis/vertex_corners.h"

#include <algorithm>
#include <cmath>

#include "core/base/index.h"
#include "core/reference/basis.h"

namespace varimesh::detail {
namespace {

/// The other ends of the edges at a vertex, counter-clockwise as seen from outside the sphere around it.
std::vector<int> neighbours(const reference::ShapeInfo& shape, int vertex) {
  std::vector<int> ends;
  for (const auto& edge : shape.edges) {
    if (edge[0] == vertex) ends.push_back(edge[1]);
    if (edge[1] == vertex) ends.push_back(edge[0]);
  }
  const auto direction = [&](int end) { return minus(shape.vertex[at(end)], shape.vertex[at(vertex)]); };
  // The ends of the edges at a pyramid's apex are the base's vertices, which are in order already.
  if (determinant(direction(ends[0]), direction(ends[1]), direction(ends[2])) < 0) std::ranges::reverse(ends);
  return ends;
}

}  // namespace

VertexCorners::LocalCorners VertexCorners::local_corners(Shape shape, int order) {
  const reference::ShapeInfo& info = reference::info(shape);
  const reference::Points& points = reference::nodes(shape, order, reference::NodeSet::Equispaced, 3);
  const auto& places = reference::node_places(shape, order);
  LocalCorners result(at(info.vertices));
  for (int v = 0; v < info.vertices; ++v) {
    for (const int end : neighbours(info, v)) {
      LocalEdge edge{{v, end}};
      for (std::size_t e = 0; e < info.edges.size(); ++e) {
        const auto& ends = info.edges[e];
        if (!((ends[0] == v && ends[1] == end) || (ends[0] == end && ends[1] == v))) continue;
        for (std::size_t n = 0; n < places.size(); ++n)
          if (places[n].dimension == 1 && places[n].index == static_cast<int>(e))
            edge.nodes.push_back(static_cast<int>(n));
      }
      std::ranges::sort(edge.nodes, {}, [&](int n) { return (points.row(n) - points.row(v)).squaredNorm(); });
      result[at(v)].push_back(std::move(edge));
    }
  }
  return result;
}

VertexCorners::VertexCorners(const HighOrderMesh& mesh, const Cells& cells, const std::vector<bool>& fixed, double sign)
    : mesh_(mesh), cells_(cells), fixed_(fixed), sign_(sign) {
  reference::Points end(1, 1);
  end(0, 0) = -1;
  const auto gradient = reference::basis_gradients(Shape::Line, mesh.order, reference::NodeSet::Equispaced, 3, end);
  // Gmsh lists a line's two ends, then the inner nodes from the first to the last.
  end_derivative_.push_back(gradient[0](0, 0));
  for (int n = 2; n <= mesh.order; ++n) end_derivative_.push_back(gradient[0](0, n));
  end_derivative_.push_back(gradient[0](0, 1));
  for (const Cells::Range& range : cells.ranges())
    if (!local_.contains(range.block->shape))
      local_.emplace(range.block->shape, local_corners(range.block->shape, range.block->order));

  std::vector<std::uint32_t> count(mesh.node_count() + 1, 0);
  const auto each_corner = [&](auto&& visit) {
    std::int32_t cell = 0;
    for (const Cells::Range& range : cells.ranges()) {
      const int vertices = reference::info(range.block->shape).vertices;
      for (std::size_t i = 0; i < range.block->size(); ++i, ++cell)
        for (int v = 0; v < vertices; ++v) {
          const std::int32_t node = range.block->nodes[i * range.stride + at(v)];
          if (fixed[at(node)]) visit(node, cell, v);
        }
    }
  };
  each_corner([&](std::int32_t node, std::int32_t, int) { ++count[at(node) + 1]; });
  for (std::size_t n = 0; n < mesh.node_count(); ++n) {
    if (count[n + 1] == 0) continue;
    nodes_.push_back(static_cast<std::int32_t>(n));
    first_.push_back(static_cast<std::uint32_t>(incidences_.size()));
    incidences_.resize(incidences_.size() + count[n + 1]);
  }
  first_.push_back(static_cast<std::uint32_t>(incidences_.size()));
  std::vector<std::uint32_t> next(mesh.node_count(), 0);
  for (std::size_t i = 0; i < nodes_.size(); ++i) next[at(nodes_[i])] = first_[i];
  each_corner([&](std::int32_t node, std::int32_t cell, int v) { incidences_[next[at(node)]++] = {cell, v}; });
}

VertexCorners::Link VertexCorners::link(std::size_t i) const {
  Link link;
  link.node = nodes_[i];
  std::vector<std::int32_t>& ends = link.ends;
  const double* origin = mesh_.coordinates.data() + 3 * at(link.node);
  const auto direction = [&](std::span<const std::int32_t> nodes, const LocalEdge& edge) {
    const std::int32_t end = nodes[at(edge.nodes.back())];
    const auto found = std::ranges::find(ends, end);
    if (found != ends.end()) return static_cast<std::int32_t>(found - ends.begin());
    LinkDirection result;
    result.fixed = true;
    for (std::size_t k = 0; k < edge.nodes.size(); ++k) {
      const auto node = at(nodes[at(edge.nodes[k])]);
      result.fixed = result.fixed && fixed_[node];
      for (std::size_t c = 0; c < 3; ++c)
        result.unit[c] += end_derivative_[k] * (mesh_.coordinates[3 * node + c] - origin[c]);
    }
    const double length = std::sqrt(dot(result.unit, result.unit));
    for (double& x : result.unit) x = length > 0 ? x / length : 0;
    ends.push_back(end);
    link.directions.push_back(result);
    return static_cast<std::int32_t>(ends.size()) - 1;
  };
  for (std::uint32_t k = first_[i]; k < first_[i + 1]; ++k) {
    const Incidence& incidence = incidences_[k];
    const auto nodes = cells_.nodes(at(incidence.cell));
    const auto& edges = local_.at(cells_.shape(at(incidence.cell)))[at(incidence.vertex)];
    LinkCorner corner;
    corner.cell = incidence.cell;
    for (std::size_t e = 0; e < edges.size(); ++e)
      corner.direction[sign_ > 0 ? e : edges.size() - 1 - e] = direction(nodes, edges[e]);
    link.corners.push_back(corner);
  }
  return link;
}

}  // namespace varimesh::detail
