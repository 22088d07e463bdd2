#include "core/curve/layers.h"

#include <Eigen/Core>
#include <algorithm>
#include <functional>
#include <map>
#include <optional>
#include <queue>
#include <tuple>

#include "core/reference/nodes.h"

namespace varimesh::detail {
namespace {

using Lattice = std::array<std::int8_t, 3>;

double distance(const std::vector<double>& x, std::int32_t a, std::int32_t b) {
  return (Eigen::Map<const Eigen::Vector3d>(&x[3 * static_cast<std::size_t>(a)]) -
          Eigen::Map<const Eigen::Vector3d>(&x[3 * static_cast<std::size_t>(b)]))
      .norm();
}

/// By an index: the indices that belong to it, in increasing order.
class Lists {
 public:
  /// @param pairs (index, what belongs to it)
  explicit Lists(std::vector<std::pair<std::int32_t, std::int32_t>> pairs) : pairs_(std::move(pairs)) {
    std::ranges::sort(pairs_);
  }
  auto of(std::int32_t index) const { return std::ranges::equal_range(pairs_, index, {}, &Pair::first); }

 private:
  using Pair = std::pair<std::int32_t, std::int32_t>;
  std::vector<Pair> pairs_;
};

/// The inner nodes of a facet of a quadrilateral.
std::vector<std::int32_t> inner_nodes(const MeshFace& face, int order, std::size_t facet) {
  const std::vector<int>& local = reference::facet_nodes(face.shape, order, static_cast<int>(facet));
  std::vector<std::int32_t> nodes;
  for (std::size_t k = 2; k < local.size(); ++k) nodes.push_back(face.nodes[static_cast<std::size_t>(local[k])]);
  return nodes;
}

/// The mean length of the edges beside a facet of a quadrilateral if it is thin away from this facet; otherwise
/// nothing.
std::optional<double> height(const MeshFace& face, std::size_t facet, const std::vector<double>& straight) {
  const auto length = [&](std::size_t k) { return distance(straight, face.nodes[k % 4], face.nodes[(k + 1) % 4]); };
  const double beside = length(facet + 1) + length(facet + 3);
  if (!(beside < kThin * (length(facet) + length(facet + 2)))) return std::nullopt;
  return beside / 2;
}

/// A step from an edge of a face, and how far it leads.
struct NextEdge {
  double height;
  std::int32_t to;
};

/// Across a thin quadrilateral to the opposite edge.
std::optional<NextEdge> across_quadrilateral(const MeshFace& face, std::int32_t from,
                                             const std::vector<double>& straight) {
  const auto facet = static_cast<std::size_t>(std::ranges::find(face.edges, from) - face.edges.begin());
  const auto high = height(face, facet, straight);
  if (!high) return std::nullopt;
  return NextEdge{*high, face.edges[(facet + 2) % 4]};
}

/// The end of the edge that the other one has too.
std::int32_t shared_end(const MeshEdge& edge, const MeshEdge& other) {
  return std::ranges::find(other.ends, edge.ends[0]) != other.ends.end() ? edge.ends[0] : edge.ends[1];
}

/// From one long edge of a thin triangle to the other.
std::optional<NextEdge> across_triangle(const MeshParts& parts, const MeshFace& face, std::int32_t from,
                                        const std::vector<double>& straight) {
  const auto length = [&](std::int32_t edge) {
    const auto& ends = parts.edges[static_cast<std::size_t>(edge)].ends;
    return distance(straight, ends[0], ends[1]);
  };
  const auto facet = static_cast<std::size_t>(std::ranges::find(face.edges, from) - face.edges.begin());
  for (const std::size_t step : {1, 2}) {
    const std::int32_t to = face.edges[(facet + step) % 3], beside = face.edges[(facet + 3 - step) % 3];
    if (2 * length(beside) < kThin * (length(from) + length(to))) return NextEdge{length(beside) / 2, to};
  }
  return std::nullopt;
}

EdgeStep step_across(const MeshParts& parts, const MeshFace& face, int order, std::int32_t from, std::int32_t to) {
  if (face.shape == Shape::Quadrilateral) {
    const auto facet = static_cast<std::size_t>(std::ranges::find(face.edges, to) - face.edges.begin());
    EdgeStep step{from, to, inner_nodes(face, order, (facet + 2) % 4), inner_nodes(face, order, facet)};
    std::ranges::reverse(step.nodes_to);  // opposite facets run against each other
    return step;
  }
  const MeshEdge &one = parts.edges[static_cast<std::size_t>(from)], &other = parts.edges[static_cast<std::size_t>(to)];
  const std::int32_t end = shared_end(one, other);
  EdgeStep step{from, to, one.inner, other.inner, 0, end};
  if (one.ends[0] != end) std::ranges::reverse(step.nodes_from);
  if (other.ends[0] != end) std::ranges::reverse(step.nodes_to);
  return step;
}

/// An edge or a face, and how far it is from the boundary along the walk, by which step.
struct Arrival {
  double far;
  std::int32_t at, step;
  std::int32_t from = -1;  ///< Of an edge: from which one.
  bool operator>(const Arrival& other) const {
    return std::tie(far, at, step) > std::tie(other.far, other.at, other.step);
  }
};
using NearestFirst = std::priority_queue<Arrival, std::vector<Arrival>, std::greater<>>;

// ===== Faces of cells =====

/// A way through a thin cell: nodes inside one face, and those opposite.
struct FaceStep {
  std::int32_t from, to;  ///< The first inner node of either face, which stands for it.
  double height;
  std::vector<std::pair<std::int32_t, std::int32_t>> nodes;
};

/// Adds the ways through one cell in one direction of its lattice, there and back.
void add_steps(Shape shape, int order, const std::int32_t* nodes, std::size_t direction, double height,
               std::vector<FaceStep>& steps) {
  const auto& lattice = reference::lattice(shape, order);
  const auto& places = reference::node_places(shape, order);
  std::map<Lattice, std::int32_t> at;
  for (std::size_t k = 0; k < lattice.size(); ++k) at[lattice[k]] = nodes[k];
  FaceStep there{}, back{};
  for (std::size_t k = 0; k < lattice.size(); ++k) {
    if (places[k].dimension != 2 || lattice[k][direction] != 0) continue;
    Lattice opposite = lattice[k];
    opposite[direction] = static_cast<std::int8_t>(order);
    there.nodes.emplace_back(nodes[k], at.at(opposite));
    back.nodes.emplace_back(at.at(opposite), nodes[k]);
  }
  if (there.nodes.empty()) return;
  const auto first = [](const FaceStep& step, auto member) { return std::ranges::min(step.nodes, {}, member).*member; };
  there.from = back.to = first(there, &std::pair<std::int32_t, std::int32_t>::first);
  there.to = back.from = first(back, &std::pair<std::int32_t, std::int32_t>::first);
  there.height = back.height = height;
  steps.push_back(std::move(there));
  steps.push_back(std::move(back));
}

/// The longest edge of a cell along a direction of its lattice if it is thin there; otherwise nothing.
std::optional<double> height(Shape shape, const std::int32_t* nodes, std::size_t direction,
                             const std::vector<double>& straight) {
  const reference::ShapeInfo& info = reference::info(shape);
  double along = 0, across = 0;
  for (const auto& edge : info.edges) {
    const auto a = static_cast<std::size_t>(edge[0]), b = static_cast<std::size_t>(edge[1]);
    double& longest = info.vertex[a][direction] != info.vertex[b][direction] ? along : across;
    longest = std::max(longest, distance(straight, nodes[a], nodes[b]));
  }
  return along < kThin * across ? std::optional(along) : std::nullopt;
}

std::vector<FaceStep> steps_through_cells(const HighOrderMesh& mesh, const std::vector<double>& straight) {
  std::vector<FaceStep> steps;
  for (const ElementBlock& block : mesh.blocks) {
    if (block.shape != Shape::Prism && block.shape != Shape::Hexahedron) continue;
    const auto stride = static_cast<std::size_t>(reference::node_count(block.shape, block.order));
    for (std::size_t e = 0; e < block.size(); ++e)
      for (std::size_t d = block.shape == Shape::Prism ? 2 : 0; d < 3; ++d)
        if (const auto high = height(block.shape, &block.nodes[e * stride], d, straight))
          add_steps(block.shape, block.order, &block.nodes[e * stride], d, *high, steps);
  }
  return steps;
}

}  // namespace

void walk_edges(const MeshParts& parts, int order, const std::vector<std::int32_t>& start,
                const std::vector<double>& straight, bool across_triangles,
                const std::function<bool(const MeshFace&)>& through, const std::function<bool(std::int32_t)>& may_move,
                const std::function<void(const EdgeStep&)>& arrive) {
  std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
  for (std::size_t f = 0; f < parts.faces.size(); ++f)
    if ((across_triangles || parts.faces[f].shape == Shape::Quadrilateral) && through(parts.faces[f]))
      for (const std::int32_t edge : parts.faces[f].edges) pairs.emplace_back(edge, static_cast<std::int32_t>(f));
  const Lists faces_of(std::move(pairs));
  std::vector<bool> reached(parts.edges.size(), false);
  for (const std::int32_t edge : start) reached[static_cast<std::size_t>(edge)] = true;
  NearestFirst next;  // an edge, and the face by which to reach it
  const auto look_around = [&](std::int32_t from, double far) {
    for (const auto& [edge, f] : faces_of.of(from)) {
      const MeshFace& face = parts.faces[static_cast<std::size_t>(f)];
      const auto across = face.shape == Shape::Quadrilateral ? across_quadrilateral(face, from, straight)
                                                             : across_triangle(parts, face, from, straight);
      if (across) next.push({far + across->height, across->to, f, from});
    }
  };
  for (const std::int32_t edge : start) look_around(edge, 0);
  while (!next.empty()) {
    const Arrival now = next.top();
    next.pop();
    if (reached[static_cast<std::size_t>(now.at)]) continue;
    reached[static_cast<std::size_t>(now.at)] = true;
    if (!may_move(now.at)) continue;
    EdgeStep step = step_across(parts, parts.faces[static_cast<std::size_t>(now.step)], order, now.from, now.at);
    step.face = now.step;
    arrive(step);
    look_around(now.at, now.far);
  }
}

std::vector<bool> move_faces_of_layers(const HighOrderMesh& mesh, const std::vector<bool>& on_surface,
                                       const std::vector<double>& straight, std::vector<double>& coordinates) {
  const std::vector<FaceStep> steps = steps_through_cells(mesh, straight);
  std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
  for (std::size_t i = 0; i < steps.size(); ++i) pairs.emplace_back(steps[i].from, static_cast<std::int32_t>(i));
  const Lists steps_from(pairs);
  std::vector<bool> moved(mesh.node_count(), false);
  NearestFirst next;
  const auto look_around = [&](std::int32_t from, double far) {
    for (const auto& [face, i] : steps_from.of(from)) {
      const FaceStep& step = steps[static_cast<std::size_t>(i)];
      next.push({far + step.height, step.to, i});
    }
  };
  for (const FaceStep& step : steps)
    if (on_surface[static_cast<std::size_t>(step.from)]) look_around(step.from, 0);
  while (!next.empty()) {
    const Arrival now = next.top();
    next.pop();
    if (on_surface[static_cast<std::size_t>(now.at)] || moved[static_cast<std::size_t>(now.at)]) continue;
    for (const auto& [of, node] : steps[static_cast<std::size_t>(now.step)].nodes) {
      moved[static_cast<std::size_t>(node)] = true;
      for (std::size_t c = 0; c < 3; ++c) {
        const std::size_t a = 3 * static_cast<std::size_t>(of) + c, b = 3 * static_cast<std::size_t>(node) + c;
        coordinates[b] = straight[b] + (coordinates[a] - straight[a]);
      }
    }
    look_around(now.at, now.far);
  }
  return moved;
}

}  // namespace varimesh::detail
