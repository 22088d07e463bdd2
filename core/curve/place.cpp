#include "core/curve/place.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/curve/blend.h"
#include "core/reference/nodes.h"

namespace varimesh::detail {
namespace {

/// An end of an edge that is farther from a curve than this, relative to the mesh's size, does not lie on it.
constexpr double kOnCurve = 1e-6;
/// Two pieces of curves whose lengths differ by less than this, relatively, are equally short.
constexpr double kEqual = 1e-9;
/// In a plane, an edge does not lie on a piece of a curve that is longer than this, relative to the distance of its
/// ends: it closes a gap between them. Around three quarters of a circle the ratio is 3.3.
constexpr double kLongest = 4;

std::size_t index(std::int32_t i) { return static_cast<std::size_t>(i); }

bool has(const std::vector<int>& list, int entry) { return std::ranges::find(list, entry) != list.end(); }

}  // namespace

BoundaryPlacing::BoundaryPlacing(HighOrderMesh& mesh, Association& association, const MeshParts& parts,
                                 const Team& team, PlacedBefore before)
    : mesh_(mesh),
      association_(association),
      parts_(parts),
      team_(team),
      stays_(std::move(before.stays)),
      straight_(before.straight.empty() ? mesh.coordinates : std::move(before.straight)) {
  for (const geometry::Curve& curve : association.geometry.curves)
    curve_searches_.push_back(std::make_unique<geometry::CurveSearch>(*curve.shape));
  surface_searches_.resize(association.geometry.surfaces.size());
  team.for_each(static_cast<std::int32_t>(surface_searches_.size()), 1, [&](std::int32_t s) {
    if (!association.surfaces[index(s)].nodes.empty())
      surface_searches_[index(s)] = std::make_unique<geometry::SurfaceSearch>(surface(s));
  });
}

void BoundaryPlacing::run() {
  find_curves();
  const auto edges = static_cast<std::int32_t>(parts_.edges.size());
  team_.for_each(edges, 16, [&](std::int32_t e) {
    if (states_[index(e)] == State::OnCurve) place_on_curve(parts_.edges[index(e)], curves_[index(e)]);
  });
  place_layers();
  team_.for_each(edges, 16, [&](std::int32_t e) {
    if (states_[index(e)] == State::OnSurface) place_on_surface(index(e));
  });
  team_.for_each(static_cast<std::int32_t>(parts_.faces.size()), 16, [&](std::int32_t f) {
    if (parts_.faces[index(f)].on_surface && !is_placed_[index(f)]) place_inside(parts_.faces[index(f)]);
  });
}

// ===== Which curve an edge lies on =====

void BoundaryPlacing::find_curves() {
  states_.assign(parts_.edges.size(), State::Inside);
  curves_.assign(parts_.edges.size(), -1);
  is_placed_.assign(parts_.faces.size(), false);
  team_.for_each(static_cast<std::int32_t>(parts_.edges.size()), 16, [&](std::int32_t e) {
    const MeshEdge& edge = parts_.edges[index(e)];
    if (edge.surfaces.empty()) return;
    if (!edge.inner.empty() && stays(edge.inner.front())) {
      states_[index(e)] = State::Placed;
      return;
    }
    if (has(edge.surfaces, -1)) {
      states_[index(e)] = State::Unsure;
      return;
    }
    const bool inside_surface = edge.surfaces.size() == 1 && edge.elements > 1;
    curves_[index(e)] = curve_of(edge);
    states_[index(e)] = curves_[index(e)] >= 0 ? State::OnCurve : inside_surface ? State::OnSurface : State::Unsure;
  });
}

/// The curves on which the edge may lie, by the surfaces around it.
std::vector<int> BoundaryPlacing::candidates(const MeshEdge& edge) const {
  const geometry::Geometry& geometry = association_.geometry;
  const int first = edge.surfaces.front();
  const bool inside_surface = edge.surfaces.size() == 1 && edge.elements > 1;
  // A periodic surface goes on past its seam, so its nodes need not stay there.
  if (inside_surface && (surface(first).u_range().period > 0 || surface(first).v_range().period > 0)) return {};
  std::vector<int> result;
  for (const int c : geometry.surfaces[index(first)].curves) {
    const std::vector<int>& around = geometry.curves[index(c)].surfaces;
    const bool of_all = std::ranges::all_of(edge.surfaces, [&](int s) { return has(around, s); });
    if (inside_surface ? around == std::vector<int>{first, first} : of_all) result.push_back(c);
  }
  return result;
}

/// The curve with the shortest piece between the ends of the edge; −1 if there is none, or if two are equally short.
int BoundaryPlacing::curve_of(const MeshEdge& edge) {
  int best = -1;
  double least = std::numeric_limits<double>::infinity(), second = least;
  for (const int c : candidates(edge)) {
    const std::vector<double> from = ends_on(c, edge.ends[0]), to = ends_on(c, edge.ends[1]);
    if (from.empty() || to.empty()) continue;
    const double length = shortest_piece(c, from, to).length();
    if (association_.in_plane && length > kLongest * chord(edge)) continue;
    if (length < least) {
      second = least;
      least = length;
      best = c;
    } else {
      second = std::min(second, length);
    }
  }
  return second <= (1 + kEqual) * least ? -1 : best;
}

/// The parameters of a vertex of the mesh on a curve: none if it does not lie there, two at the joint of a closed
/// curve.
std::vector<double> BoundaryPlacing::ends_on(int curve, std::int32_t node) const {
  const NodeEntity& entity = association_.nodes[index(node)];
  const geometry::CurveShape& shape = *association_.geometry.curves[index(curve)].shape;
  const geometry::Range range = shape.range();
  double t = entity.at[0];
  if (entity.dimension != 1 || entity.entity != curve) {
    const Eigen::Vector3d at = Eigen::Map<const Eigen::Vector3d>(&mesh_.coordinates[3 * index(node)]);
    const geometry::CurveFoot foot = curve_searches_[index(curve)]->closest(at);
    if (!(foot.distance <= kOnCurve * association_.size)) return {};
    t = foot.t;
  }
  if (range.period > 0) return {t};
  const Eigen::Vector3d first = shape.at(range.first).x, last = shape.at(range.last).x, here = shape.at(t).x;
  const double close = kOnCurve * association_.size;
  if ((first - last).norm() <= close && (here - first).norm() <= close) return {range.first, range.last};
  return {t};
}

CurvePiece BoundaryPlacing::shortest_piece(int curve, const std::vector<double>& from,
                                           const std::vector<double>& to) const {
  const geometry::CurveShape& shape = *association_.geometry.curves[index(curve)].shape;
  std::vector<double> ends = to;
  if (const double period = shape.range().period; period > 0) {
    // A parameter may be whole periods outside its range. The nearest one within half a period comes first.
    ends[0] -= period * std::round((ends[0] - from[0]) / period);
    ends.push_back(ends[0] + (ends[0] < from[0] ? period : -period));
  }
  CurvePiece best(shape, from[0], ends[0]);
  for (std::size_t i = 0; i < from.size(); ++i)
    for (std::size_t j = 0; j < ends.size(); ++j) {
      if (i == 0 && j == 0) continue;
      CurvePiece piece(shape, from[i], ends[j]);
      if (piece.length() < best.length() && piece.length() > 0) best = std::move(piece);
    }
  return best;
}

// ===== Where the new nodes go =====

void BoundaryPlacing::put(std::int32_t node, std::int8_t dimension, int entity, const PlacedPoint& point) {
  x(node) = point.x;
  association_.nodes[index(node)] = {dimension, entity, 0, point.at};
}

PlacedPoint BoundaryPlacing::on_surface(int surface, std::int32_t node) {
  return {association_.surfaces[index(surface)].of(node), x(node)};
}

void BoundaryPlacing::place_on_curve(const MeshEdge& edge, int curve) {
  const CurvePiece piece = shortest_piece(curve, ends_on(curve, edge.ends[0]), ends_on(curve, edge.ends[1]));
  for (std::size_t i = 0; i < edge.inner.size(); ++i)
    put(edge.inner[i], 1, curve,
        piece.at_length(piece.length() * static_cast<double>(i + 1) / static_cast<double>(edge.inner.size() + 1)));
  for (const int s : edge.surfaces) {
    std::array<double, 2> guess = association_.surfaces[index(s)].of(edge.ends[0]);
    for (const std::int32_t node : edge.inner) {
      const auto foot = foot_within(surface(s), search(s), x(node), guess, kMatchTolerance * association_.size);
      if (foot) guess = foot->at;
      association_.surfaces[index(s)].of(node) = guess;
    }
  }
}

/// On each surface, the edges of thin quadrilaterals move as those on the curve. In a plane, those of thin triangles do
/// too.
void BoundaryPlacing::place_layers() {
  std::vector<std::int32_t> start;
  for (std::size_t e = 0; e < states_.size(); ++e)
    if (states_[e] == State::OnCurve) start.push_back(static_cast<std::int32_t>(e));
  walk_edges(
      parts_, mesh_.order, start, straight_, association_.in_plane,
      [](const MeshFace& face) { return face.surface >= 0; },
      [&](std::int32_t edge) { return states_[index(edge)] == State::OnSurface; },
      [&](const EdgeStep& step) {
        const MeshEdge& edge = parts_.edges[index(step.to)];
        const int s = edge.surfaces.front();
        std::vector<PlacedPoint> points;
        std::array<double, 2> guess = association_.surfaces[index(s)].of(edge.ends[0]);
        if (step.nodes_to.size() > 1 && step.nodes_to.front() != edge.inner.front())
          guess = association_.surfaces[index(s)].of(edge.ends[1]);
        for (std::size_t i = 0; i < step.nodes_to.size(); ++i) {
          const std::size_t of = 3 * index(step.nodes_from[i]), to = 3 * index(step.nodes_to[i]);
          const Eigen::Vector3d wish = Eigen::Map<const Eigen::Vector3d>(&straight_[to]) + x(step.nodes_from[i]) -
                                       Eigen::Map<const Eigen::Vector3d>(&straight_[of]);
          const auto foot = foot_within(surface(s), search(s), wish, guess, 0.5 * chord(edge));
          if (!foot) return;
          guess = foot->at;
          points.push_back(*foot);
        }
        for (std::size_t i = 0; i < points.size(); ++i) {
          put(step.nodes_to[i], 2, s, points[i]);
          association_.surfaces[index(s)].of(step.nodes_to[i]) = points[i].at;
        }
        states_[index(step.to)] = State::Placed;
        if (step.shared >= 0) place_inside_thin(step);
      });
}

void BoundaryPlacing::place_on_surface(std::size_t e) {
  const MeshEdge& edge = parts_.edges[e];
  const int s = edge.surfaces.front();
  const auto points = points_between(surface(s), search(s), on_surface(s, edge.ends[0]), on_surface(s, edge.ends[1]),
                                     static_cast<int>(edge.inner.size()));
  if (!points) return;
  for (std::size_t i = 0; i < points->size(); ++i) {
    put(edge.inner[i], 2, s, (*points)[i]);
    association_.surfaces[index(s)].of(edge.inner[i]) = (*points)[i].at;
  }
}

/// The nodes inside a thin triangle move as those of its long edges that are as far from the vertex between these.
void BoundaryPlacing::place_inside_thin(const EdgeStep& step) {
  const MeshFace& face = parts_.faces[index(step.face)];
  const auto corner = std::ranges::find(face.nodes, step.shared) - face.nodes.begin();
  const auto& lattice = reference::lattice(face.shape, mesh_.order);
  const auto straight = [&](std::int32_t node) {
    return Eigen::Map<const Eigen::Vector3d>(&straight_[3 * index(node)]);
  };
  for (const int local : inner_blend(face.shape, mesh_.order).inner) {
    const std::int32_t node = face.nodes[index(local)];
    const int i = lattice[index(local)][0], j = lattice[index(local)][1];
    const int away = mesh_.order - (corner == 0 ? mesh_.order - i - j : corner == 1 ? i : j);
    const std::int32_t from = step.nodes_from[index(away) - 1], to = step.nodes_to[index(away) - 1];
    const auto foot =
        foot_within(surface(face.surface), search(face.surface), straight(node) + x(from) - straight(from),
                    on_surface(face.surface, to).at, 0.5 * chord(parts_.edges[index(step.to)]));
    if (!foot) return;
    put(node, 2, face.surface, *foot);
    association_.surfaces[index(face.surface)].of(node) = foot->at;
  }
  is_placed_[index(step.face)] = true;
}

void BoundaryPlacing::place_inside(const MeshFace& face) {
  const InnerBlend& inside = inner_blend(face.shape, mesh_.order);
  if (!inside.inner.empty() && stays(face.nodes[index(inside.inner.front())])) return;
  move_inner(inside, face.nodes.data(), straight_, mesh_.coordinates);
  if (face.surface < 0) return;
  const auto around = static_cast<std::size_t>(inside.weights.cols()) - inside.inner.size();
  double longest = 0;
  for (const std::int32_t edge : face.edges) longest = std::max(longest, chord(parts_.edges[index(edge)]));
  for (const int local : inside.inner) {
    const std::int32_t node = face.nodes[static_cast<std::size_t>(local)];
    std::int32_t nearest = face.nodes[0];
    for (std::size_t k = 1; k < around; ++k)
      if ((x(face.nodes[k]) - x(node)).norm() < (x(nearest) - x(node)).norm()) nearest = face.nodes[k];
    const auto foot = foot_within(surface(face.surface), search(face.surface), x(node),
                                  on_surface(face.surface, nearest).at, 0.5 * longest);
    if (!foot) continue;
    put(node, 2, face.surface, *foot);
    association_.surfaces[index(face.surface)].of(node) = foot->at;
  }
}

}  // namespace varimesh::detail
