#include "core/association/plane/profile.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>

#include "core/association/match.h"
#include "core/association/repeated.h"
#include "core/association/units.h"
#include "core/geometry/analytic.h"
#include "core/geometry/closest_point.h"
#include "core/mesh/plane.h"
#include "core/reference/nodes.h"

namespace varimesh {
namespace {

using geometry::Geometry;

/// A curve lies in the plane if its samples are nearer to it than this, relative to the mesh's diagonal.
constexpr double kInPlane = 1e-6;
constexpr int kSamples = 32;  ///< Of a curve, less one.
/// Closer than this, relative to the size, a node is a vertex, or lies on a curve between regions.
constexpr double kExactly = 1e-6;
/// Two curves whose distances differ by less than this, relative to the size, are equally near.
constexpr double kRivalTolerance = 1e-9;

std::size_t index(std::int32_t i) { return static_cast<std::size_t>(i); }

Eigen::Map<const Eigen::Vector3d> position(const HighOrderMesh& mesh, std::int32_t node) {
  return Eigen::Map<const Eigen::Vector3d>(&mesh.coordinates[3 * index(node)]);
}

/// An edge at which elements of the mesh end, or at which regions meet.
struct OuterEdge {
  std::vector<std::int32_t> nodes;  ///< In Gmsh's order.
  bool is_border = false;
};

std::vector<OuterEdge> outer_edges(const HighOrderMesh& mesh) {
  struct Side {
    std::int32_t low, high;
    std::size_t block, element;
    int facet;
    auto ends() const { return std::pair(low, high); }
  };
  std::vector<Side> sides;
  const auto local = [&](std::size_t b, int facet) -> const std::vector<int>& {
    return reference::facet_nodes(mesh.blocks[b].shape, mesh.blocks[b].order, facet);
  };
  const auto node = [&](const Side& side, int k) {
    const ElementBlock& block = mesh.blocks[side.block];
    return block.nodes[side.element * (block.nodes.size() / block.size()) + static_cast<std::size_t>(k)];
  };
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    if (reference::info(mesh.blocks[b].shape).dimension != 2) continue;
    const auto facets = static_cast<int>(reference::info(mesh.blocks[b].shape).facets.size());
    for (std::size_t e = 0; e < mesh.blocks[b].size(); ++e)
      for (int f = 0; f < facets; ++f) {
        Side side{0, 0, b, e, f};
        std::tie(side.low, side.high) = std::minmax({node(side, local(b, f)[0]), node(side, local(b, f)[1])});
        sides.push_back(side);
      }
  }
  std::ranges::stable_sort(sides, {}, &Side::ends);
  std::vector<OuterEdge> edges;
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t next = i + 1;
    bool differ = false;
    for (; next < sides.size() && sides[next].ends() == sides[i].ends(); ++next)
      differ = differ || mesh.blocks[sides[next].block].entity != mesh.blocks[sides[i].block].entity;
    if (next - i == 1 || differ) {
      edges.push_back({{}, next - i == 1});
      for (const int k : local(sides[i].block, sides[i].facet)) edges.back().nodes.push_back(node(sides[i], k));
    }
    i = next;
  }
  return edges;
}

/// The plane of the mesh, and the rectangle around its nodes.
struct Ground {
  geometry::Frame frame;
  double width = 0, height = 0, diagonal = 0;

  Ground(const HighOrderMesh& mesh, const Team& team) {
    if (const auto plane = Plane::of(mesh, team)) {
      const auto at = [&](double u, double v) {
        const auto x = plane->in_space(u, v);
        return Eigen::Vector3d(x[0], x[1], x[2]);
      };
      frame.origin = at(0, 0);
      frame.axes.col(0) = at(1, 0) - frame.origin;
      frame.axes.col(1) = at(0, 1) - frame.origin;
      frame.axes.col(2) = Eigen::Vector3d(plane->normal()[0], plane->normal()[1], plane->normal()[2]);
    }
    Eigen::AlignedBox3d box;
    // Other nodes, such as the centre of an arc, may lie anywhere.
    for (const ElementBlock& block : mesh.blocks)
      if (reference::info(block.shape).dimension == 2)
        for (const std::int32_t node : block.nodes) box.extend(local(position(mesh, node)));
    diagonal = box.diagonal().norm();
    // Wider than the mesh, so that each node lies inside.
    const Eigen::Vector3d corner = box.min() - Eigen::Vector3d(diagonal, diagonal, -box.diagonal()[2] / 2);
    frame.origin += frame.axes * corner;
    width = box.diagonal()[0] + 2 * diagonal;
    height = box.diagonal()[1] + 2 * diagonal;
  }
  Eigen::Vector3d local(const Eigen::Vector3d& x) const { return frame.axes.transpose() * (x - frame.origin); }
};

/// The curves in the plane with their ends, without what is there twice, and the box around them.
Geometry curves_in(const Ground& ground, const Geometry& of, const Team& team, Eigen::AlignedBox3d& box) {
  Geometry result;
  std::map<int, int> vertex;
  for (const geometry::Curve& curve : of.curves) {
    const geometry::Range range = curve.shape->range();
    Eigen::AlignedBox3d own;
    bool is_in = true;
    for (int i = 0; i <= kSamples && is_in; ++i) {
      const Eigen::Vector3d x = curve.shape->at(range.first + i * range.length() / kSamples).x;
      is_in = std::abs(ground.local(x)[2]) <= kInPlane * ground.diagonal;
      own.extend(x);
    }
    if (!is_in) continue;
    box.extend(own);
    geometry::Curve taken{curve.tag, curve.shape, {}, {}};
    for (const int v : curve.vertices) {
      const auto [at, is_new] = vertex.try_emplace(v, static_cast<int>(result.vertices.size()));
      if (is_new) result.vertices.push_back(of.vertices[static_cast<std::size_t>(v)]);
      taken.vertices.push_back(at->second);
    }
    result.curves.push_back(std::move(taken));
  }
  if (!box.isEmpty()) detail::merge_repeated(result, kExactly * box.diagonal().norm(), team);
  return result;
}

/// The mesh and a geometry in one unit of length.
class Placing {
 public:
  Placing(const HighOrderMesh& mesh, const Ground& ground, const std::vector<OuterEdge>& edges,
          const Geometry& geometry, const Team& team)
      : mesh_(mesh), ground_(ground), edges_(edges), curves_(curves_in(ground, geometry, team, box_)) {
    for (const geometry::Curve& curve : curves_.curves) searches_.emplace_back(*curve.shape);
    size_ = box_.isEmpty() ? ground.diagonal : std::min(ground.diagonal, box_.diagonal().norm());
    nodes_.assign(mesh.node_count(), {});
    std::vector<std::int8_t> kind(mesh.node_count(), 0);
    for (const OuterEdge& edge : edges)
      for (const std::int32_t node : edge.nodes)
        kind[index(node)] = std::max<std::int8_t>(kind[index(node)], edge.is_border ? 2 : 1);
    team.for_each(static_cast<std::int32_t>(kind.size()), 16, [&](std::int32_t node) {
      if (kind[index(node)] > 0)
        nodes_[index(node)] = entity(node, kind[index(node)] == 2 ? kMatchTolerance : kExactly);
    });
  }

  bool any() const { return !curves_.curves.empty(); }
  double curves_size() const { return box_.isEmpty() ? 0 : box_.diagonal().norm(); }
  std::ptrdiff_t border() const { return std::ranges::count_if(edges_, &OuterEdge::is_border); }
  /// How many edges of the border have both ends on curves.
  std::ptrdiff_t matched() const {
    return std::ranges::count_if(edges_, [&](const OuterEdge& edge) {
      return edge.is_border && nodes_[index(edge.nodes[0])].dimension >= 0 &&
             nodes_[index(edge.nodes[1])].dimension >= 0;
    });
  }

  /// Whether more than chance says that the mesh belongs to the geometry: a few edges that lie on its curves, a part of
  /// the border, or half of a curve.
  bool belongs() const {
    const std::ptrdiff_t edges = matched();
    if (edges >= kSure || (edges > 0 && 4 * edges >= border())) return true;
    std::vector<double> covered(curves_.curves.size(), 0);
    for (const OuterEdge& edge : edges_) {
      if (!edge.is_border) continue;
      const NodeEntity &one = nodes_[index(edge.nodes[0])], &other = nodes_[index(edge.nodes[1])];
      for (std::size_t c = 0; c < covered.size(); ++c)
        if (lies_on(one, c) && lies_on(other, c))
          covered[c] += (position(mesh_, edge.nodes[0]) - position(mesh_, edge.nodes[1])).norm();
    }
    for (std::size_t c = 0; c < covered.size(); ++c)
      if (covered[c] > 0 && 2 * covered[c] >= length(c)) return true;
    return false;
  }

  Association result() {
    Association result;
    result.in_plane = true;
    result.size = size_;
    result.geometry = std::move(curves_);
    result.geometry.surfaces.push_back(
        {1, geometry::plane(ground_.frame, ground_.width, ground_.height), {}, std::string()});
    for (std::size_t c = 0; c < result.geometry.curves.size(); ++c) {
      result.geometry.surfaces[0].curves.push_back(static_cast<int>(c));
      result.geometry.curves[c].surfaces = {0};
    }
    for (const OuterEdge& edge : edges_) {
      const NodeEntity &one = nodes_[index(edge.nodes[0])], &other = nodes_[index(edge.nodes[1])];
      if (edge.is_border || one.dimension < 0 || other.dimension < 0) continue;
      // The plane lies on both sides of this curve.
      for (const NodeEntity& end : {one, other})
        if (end.dimension == 1) result.geometry.curves[index(end.entity)].surfaces = {0, 0};
    }
    result.nodes = std::move(nodes_);
    place_others(result);
    return result;
  }

 private:
  /// So many edges lie on curves only if the mesh belongs to them.
  static constexpr std::ptrdiff_t kSure = 3;

  bool lies_on(const NodeEntity& entity, std::size_t curve) const {
    if (entity.dimension == 1) return index(entity.entity) == curve;
    const std::vector<int>& ends = curves_.curves[curve].vertices;
    return entity.dimension == 0 && std::ranges::find(ends, entity.entity) != ends.end();
  }
  double length(std::size_t curve) const {
    const geometry::CurveShape& shape = *curves_.curves[curve].shape;
    const geometry::Range range = shape.range();
    double sum = 0;
    for (int i = 0; i < kSamples; ++i)
      sum += (shape.at(range.first + (i + 1) * range.length() / kSamples).x -
              shape.at(range.first + i * range.length() / kSamples).x)
                 .norm();
    return sum;
  }

  NodeEntity entity(std::int32_t node, double tolerance) const {
    const Eigen::Vector3d x = position(mesh_, node);
    NodeEntity best;
    double least = kExactly * size_;
    for (std::size_t v = 0; v < curves_.vertices.size(); ++v)
      if (const double distance = (curves_.vertices[v].x - x).norm(); distance <= least) {
        least = distance;
        best = {0, static_cast<std::int32_t>(v), distance, {}};
      }
    if (best.dimension == 0) return best;
    least = tolerance * size_;
    double second = least;
    for (std::size_t c = 0; c < searches_.size(); ++c) {
      const geometry::CurveFoot foot = searches_[c].closest(x);
      if (foot.distance >= least) {
        second = std::min(second, foot.distance);
        continue;
      }
      second = best.dimension < 0 ? std::numeric_limits<double>::infinity() : least;
      least = foot.distance;
      best = {1, static_cast<std::int32_t>(c), foot.distance, {foot.t, 0}};
    }
    return second - least < kRivalTolerance * size_ ? NodeEntity{} : best;
  }

  void place_others(Association& result) const {
    std::vector<bool> is_border(mesh_.node_count(), false), is_in(mesh_.node_count(), false);
    for (const OuterEdge& edge : edges_)
      for (const std::int32_t node : edge.nodes) is_border[index(node)] = is_border[index(node)] || edge.is_border;
    std::map<int, std::int64_t> elements;
    for (const ElementBlock& block : mesh_.blocks) {
      const bool is_plane = reference::info(block.shape).dimension == 2;
      result.surface_of_element.emplace_back(is_plane ? block.size() : 0, 0);
      if (!is_plane) continue;
      elements[block.entity] += static_cast<std::int64_t>(block.size());
      for (const std::int32_t node : block.nodes) is_in[index(node)] = true;
    }
    for (const auto& [tag, count] : elements) result.matches.push_back({tag, 0, -1, false, 0, count, 0});
    SurfaceNodes& own = result.surfaces.emplace_back();
    for (std::int32_t node = 0; node < static_cast<std::int32_t>(is_in.size()); ++node) {
      if (!is_in[index(node)]) continue;
      const Eigen::Vector3d at = ground_.local(position(mesh_, node));
      own.nodes.push_back(node);
      own.parameters.push_back({at[0], at[1]});
      NodeEntity& entity = result.nodes[index(node)];
      if (entity.dimension >= 0) continue;
      if (is_border[index(node)])
        result.held.push_back(node);
      else
        entity = {2, 0, std::abs(at[2]), {at[0], at[1]}};
    }
  }

  const HighOrderMesh& mesh_;
  const Ground& ground_;
  const std::vector<OuterEdge>& edges_;
  Eigen::AlignedBox3d box_;  ///< Before curves_, which sets it.
  Geometry curves_;
  std::vector<geometry::CurveSearch> searches_;
  double size_ = 0;
  std::vector<NodeEntity> nodes_;
};

}  // namespace

Expected<Association> associate_in_plane(const HighOrderMesh& mesh, const Geometry& geometry, const Team& team) {
  const Ground ground(mesh, team);
  const std::vector<OuterEdge> edges = outer_edges(mesh);
  Placing best(mesh, ground, edges, geometry, team);
  const double geometry_size = best.any() ? best.curves_size() : geometry::size(geometry);
  const double other_factor = detail::unit_factor(ground.diagonal, geometry_size);
  if (other_factor != 1 && best.matched() < best.border()) {
    Placing other(mesh, ground, edges, geometry::scaled(geometry, other_factor), team);
    if (other.matched() > best.matched()) {
      Association result = other.result();
      result.factor = other_factor;
      return result;
    }
  }
  if (!best.any())
    return bad_input("No curve of the geometry lies in the plane of the mesh; check that they belong together.");
  if (!best.belongs())
    return bad_input((best.matched() == 0
                          ? "No edge on the boundary of the mesh lies on a curve of the geometry."
                          : "Only " + std::to_string(best.matched()) + " of " + std::to_string(best.border()) +
                                " edges on the boundary of the mesh lie on curves of the geometry.") +
                     std::string(" The mesh is ") + detail::number_text(ground.diagonal) + " across and the geometry " +
                     detail::number_text(geometry_size) +
                     "; check that they belong together and have the same origin and unit of length.");
  return best.result();
}

std::vector<std::string> describe_in_plane(const HighOrderMesh& mesh, const Association& association,
                                           double tolerance) {
  std::array<std::size_t, 2> on{};
  std::size_t off = 0;
  double largest = 0;
  for (const NodeEntity& entity : association.nodes) {
    if (entity.dimension != 0 && entity.dimension != 1) continue;
    ++on[static_cast<std::size_t>(entity.dimension)];
    largest = std::max(largest, entity.distance);
    off += entity.distance > tolerance * association.size ? 1 : 0;
  }
  std::vector<std::string> sentences;
  const std::size_t curves = association.geometry.curves.size();
  sentences.push_back("Geometry: " + std::to_string(curves) + (curves == 1 ? " curve lies" : " curves lie") +
                      " in the plane of the mesh; " + std::to_string(on[0]) + " boundary nodes on vertices, " +
                      std::to_string(on[1]) + " on curves, at most " + detail::number_text(largest) + " from them.");
  if (association.factor != 1)
    sentences.push_back("Lengths in the mesh are " + detail::number_text(association.factor) +
                        " times those in the geometry, which was scaled.");
  if (!association.held.empty())
    sentences.push_back(std::to_string(association.held.size()) +
                        " boundary nodes lie on no curve of the geometry for sure and stay where they are, node " +
                        std::to_string(mesh.node_numbers[index(association.held.front())]) + " among them.");
  if (off > 0) sentences.push_back(std::to_string(off) + " nodes are off their curves; snapping moves them there.");
  return sentences;
}

}  // namespace varimesh
