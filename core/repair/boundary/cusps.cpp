#include "core/repair/boundary/cusps.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>
#include <optional>
#include <unordered_set>
#include <utility>

#include "core/base/counted.h"
#include "core/base/index.h"
#include "core/curve/parts.h"
#include "core/mesh/connectivity.h"

namespace varimesh {
namespace {

using detail::MeshEdge;
using detail::MeshFace;
using Eigen::Vector3d;

constexpr double kDegrees = 180 / std::numbers::pi;

double angle(const Vector3d& a, const Vector3d& b) { return kDegrees * std::atan2(a.cross(b).norm(), a.dot(b)); }

/// An angle and where it is.
struct Found {
  double angle = 0;
  Vector3d x;
};

/// Some elements of a mesh, without its nodes.
struct Part {
  HighOrderMesh mesh;
  std::vector<std::vector<int>> surface_of_element;  ///< As Association has it.
};

/// The elements that have a vertex of a wanted tetrahedron.
Part elements_around(const HighOrderMesh& mesh, const Association& association, std::span<const std::int64_t> wanted) {
  std::unordered_set<std::int32_t> vertices;
  const Cells cells(mesh, 3);
  for (std::size_t c = 0; c < cells.count(); ++c)
    if (cells.shape(c) == Shape::Tetrahedron && std::ranges::binary_search(wanted, cells.number(c)))
      for (const std::int32_t vertex : cells.nodes(c).first(4)) vertices.insert(vertex);
  Part part;
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const ElementBlock& all = mesh.blocks[b];
    const reference::ShapeInfo& info = reference::info(all.shape);
    if (info.dimension < 2) continue;
    ElementBlock some;
    some.shape = all.shape;
    some.order = all.order;
    std::vector<int> surfaces;
    const std::size_t stride = at(reference::node_count(all.shape, all.order));
    for (std::size_t e = 0; e < all.size(); ++e) {
      const auto nodes = std::span(all.nodes).subspan(e * stride, stride);
      if (std::ranges::none_of(nodes.first(at(info.vertices)), [&](auto node) { return vertices.contains(node); }))
        continue;
      some.numbers.push_back(all.numbers[e]);
      some.nodes.insert(some.nodes.end(), nodes.begin(), nodes.end());
      if (info.dimension == 2) surfaces.push_back(association.surface_of_element[b][e]);
    }
    part.mesh.blocks.push_back(std::move(some));
    part.surface_of_element.push_back(std::move(surfaces));
  }
  return part;
}

/// Finds cusps, and gathers those of the same sides.
class Search {
 public:
  Search(const HighOrderMesh& mesh, Association& association, std::span<const std::int64_t> wanted)
      : mesh_(mesh),
        association_(association),
        part_(elements_around(mesh, association, wanted)),
        parts_(part_.mesh, part_.surface_of_element),
        cells_(part_.mesh, 3) {
    for (std::size_t c = 0; c < cells_.count(); ++c) {
      if (cells_.shape(c) != Shape::Tetrahedron) continue;
      const bool is_wanted = std::ranges::binary_search(wanted, cells_.number(c));
      for (const std::int32_t vertex : cells_.nodes(c).first(4)) {
        cells_at_[vertex].push_back(c);
        if (is_wanted) wanted_at_[vertex].push_back(cells_.number(c));
      }
    }
  }

  std::vector<Cusp> run() {
    std::map<std::int32_t, std::vector<const MeshFace*>> around;  // by edge
    // By surface and node at a vertex. A surface has two faces at a seam, whose edge counts once.
    std::map<std::pair<int, std::int32_t>, std::set<std::int32_t>> corners;
    for (const MeshFace& face : parts_.faces) {
      if (!face.on_surface || face.surface < 0 || face.shape != Shape::Triangle) continue;
      for (const std::int32_t e : face.edges) {
        const MeshEdge& edge = parts_.edges[at(e)];
        if (edge.inner.empty() || entity(edge.inner.front()).dimension != 1) continue;
        around[e].push_back(&face);
        for (const std::int32_t end : edge.ends)
          if (entity(end).dimension == 0 && wanted_at_.contains(end)) corners[{face.surface, end}].insert(e);
      }
    }
    for (const auto& [e, faces] : around) look_along(parts_.edges[at(e)], faces);
    for (const auto& [place, edges] : corners)
      if (edges.size() == 2) look_in_corner(place.first, place.second, *edges.begin(), *edges.rbegin());
    std::vector<Cusp> result;
    for (auto& [sides, cusp] : by_sides_) result.push_back(std::move(cusp));
    return result;
  }

 private:
  const NodeEntity& entity(std::int32_t node) const { return association_.nodes[at(node)]; }
  Vector3d x(std::int32_t node) const { return Eigen::Map<const Vector3d>(&mesh_.coordinates[3 * at(node)]); }

  /// Looks at each wedge of cells between two elements of surfaces at the edge.
  void look_along(const MeshEdge& edge, const std::vector<const MeshFace*>& faces) {
    if (!wanted_at_.contains(edge.ends[0]) && !wanted_at_.contains(edge.ends[1])) return;
    std::map<std::int32_t, const MeshFace*> by_apex;
    for (const MeshFace* face : faces) by_apex.emplace(apex_of(*face, edge), face);
    std::vector<std::array<std::int32_t, 2>> cells = others_around(edge);
    for (const auto& [apex, face] : by_apex) {
      double room = 0;  // of the straight cells
      for (std::int32_t at_apex = apex;;) {
        const auto cell = std::ranges::find_if(
            cells, [&](const auto& others) { return others[0] == at_apex || others[1] == at_apex; });
        if (cell == cells.end()) break;
        room += angle(across(edge, (*cell)[0]), across(edge, (*cell)[1]));
        at_apex = (*cell)[0] == at_apex ? (*cell)[1] : (*cell)[0];
        cells.erase(cell);
        if (const auto other = by_apex.find(at_apex); other != by_apex.end()) {
          if (room < 180) look_between(edge, *face, *other->second);
          break;
        }
      }
    }
  }

  void look_between(const MeshEdge& edge, const MeshFace& a, const MeshFace& b) {
    std::vector<std::int32_t> nodes(edge.ends.begin(), edge.ends.end());
    nodes.insert(nodes.end(), edge.inner.begin(), edge.inner.end());
    std::optional<Found> least;
    for (const std::int32_t node : nodes) {
      const std::optional<Vector3d> to_a = into(a, edge, node), to_b = into(b, edge, node);
      if (to_a && to_b && (!least || angle(*to_a, *to_b) < least->angle)) least = {angle(*to_a, *to_b), x(node)};
    }
    if (!least || least->angle > kMostAtCusp) return;
    const auto [first, second] = std::minmax(a.surface, b.surface);
    add("surfaces " + surface(first).number_text() + " and " + surface(second).number_text(), *least, edge.ends);
  }

  static std::int32_t apex_of(const MeshFace& face, const MeshEdge& edge) {
    return *std::ranges::find_if(std::span(face.nodes).first(3),
                                 [&](std::int32_t node) { return node != edge.ends[0] && node != edge.ends[1]; });
  }

  /// By cell around the edge: its vertices that are not ends of the edge.
  std::vector<std::array<std::int32_t, 2>> others_around(const MeshEdge& edge) const {
    std::vector<std::array<std::int32_t, 2>> result;
    const auto cells = cells_at_.find(edge.ends[0]);
    for (const std::size_t cell : cells == cells_at_.end() ? std::vector<std::size_t>{} : cells->second) {
      std::vector<std::int32_t> others;
      for (const std::int32_t vertex : cells_.nodes(cell).first(4))
        if (vertex != edge.ends[0] && vertex != edge.ends[1]) others.push_back(vertex);
      if (others.size() == 2) result.push_back({others[0], others[1]});
    }
    return result;
  }

  /// From the straight edge to a node, perpendicular to the edge.
  Vector3d across(const MeshEdge& edge, std::int32_t node) const {
    const Vector3d along = (x(edge.ends[1]) - x(edge.ends[0])).normalized(), to = x(node) - x(edge.ends[0]);
    return to - to.dot(along) * along;
  }

  /// The unit vector at a node of the edge that goes into the face along its surface, across the edge. Nothing at a
  /// pole.
  std::optional<Vector3d> into(const MeshFace& face, const MeshEdge& edge, std::int32_t node) const {
    const geometry::SurfaceShape& shape = *surface(face.surface).shape;
    const auto [u, v] = association_.surfaces[at(face.surface)].of(node);
    const Vector3d normal = shape.normal(shape.at(u, v), u, v), along = x(edge.ends[1]) - x(edge.ends[0]);
    const Vector3d across = normal.cross(along);
    if (!across.allFinite() || !(across.norm() > 0)) return std::nullopt;
    return (across.dot(x(apex_of(face, edge)) - x(node)) > 0 ? across : -across).normalized();
  }

  void look_in_corner(int s, std::int32_t node, std::int32_t a, std::int32_t b) {
    const std::optional<Vector3d> first = out_of(node, parts_.edges[at(a)]), second = out_of(node, parts_.edges[at(b)]);
    if (!first || !second || angle(*first, *second) > kMostAtCusp || room_in_corner(s, node) > 180) return;
    const auto tag = [&](std::int32_t e) {
      return association_.geometry.curves[at(entity(parts_.edges[at(e)].inner.front()).entity)].tag;
    };
    const auto [least, most] = std::minmax({tag(a), tag(b)});
    add((least == most ? "the ends of curve " + std::to_string(least)
                       : "curves " + std::to_string(least) + " and " + std::to_string(most)) +
            " of surface " + surface(s).number_text(),
        {angle(*first, *second), x(node)}, {node, node});
  }

  /// The unit tangent at an end of the edge's curve, away from this end.
  std::optional<Vector3d> out_of(std::int32_t end, const MeshEdge& edge) const {
    const std::int32_t next = edge.ends[0] == end ? edge.inner.front() : edge.inner.back();
    const geometry::CurveShape& curve = *association_.geometry.curves[at(entity(next).entity)].shape;
    const geometry::Range range = curve.range();
    const bool is_first = std::abs(entity(next).at[0] - range.first) < std::abs(entity(next).at[0] - range.last);
    const Vector3d along = curve.at(is_first ? range.first : range.last).dt;
    if (!along.allFinite() || !(along.norm() > 0)) return std::nullopt;
    return (is_first ? along : -along).normalized();
  }

  /// The angle of the surface at the node: the sum over its straight triangles.
  double room_in_corner(int s, std::int32_t node) const {
    double sum = 0;
    for (const MeshFace& face : parts_.faces) {
      if (!face.on_surface || face.surface != s || face.shape != Shape::Triangle) continue;
      std::vector<Vector3d> to;
      for (const std::int32_t vertex : std::span(face.nodes).first(3))
        if (vertex != node) to.push_back(x(vertex) - x(node));
      if (to.size() == 2) sum += angle(to[0], to[1]);
    }
    return sum;
  }

  const geometry::Surface& surface(int s) const { return association_.geometry.surfaces[at(s)]; }

  void add(const std::string& sides, const Found& found, std::array<std::int32_t, 2> ends) {
    const auto [cusp, is_new] = by_sides_.try_emplace(sides, Cusp{found.angle, found.x, sides, {}});
    if (found.angle < cusp->second.angle) {
      cusp->second.angle = found.angle;
      cusp->second.x = found.x;
    }
    for (const std::int32_t end : ends)
      if (const auto cells = wanted_at_.find(end); cells != wanted_at_.end())
        cusp->second.cells.insert(cells->second.begin(), cells->second.end());
  }

  const HighOrderMesh& mesh_;
  Association& association_;
  const Part part_;
  const detail::MeshParts parts_;
  const Cells cells_;
  std::map<std::int32_t, std::vector<std::size_t>> cells_at_;
  std::map<std::int32_t, std::vector<std::int64_t>> wanted_at_;
  std::map<std::string, Cusp> by_sides_;
};

}  // namespace

std::vector<Cusp> cusps(const HighOrderMesh& mesh, Association& association, std::span<const std::int64_t> wanted) {
  return mesh.dimension == 3 && !association.in_plane ? Search(mesh, association, wanted).run() : std::vector<Cusp>{};
}

std::int64_t bytes_of_cusps(const MeshCounts& counts) {
  // A block of the heap has a header, and its size is a multiple of 16. Arrays that grow have up to twice their size.
  const auto block = [](std::int64_t bytes) { return std::max<std::int64_t>(32, (bytes + 8 + 15) / 16 * 16); };
  constexpr auto kIndex = std::int64_t{sizeof(std::int32_t)};
  constexpr std::int64_t kTableEntry = 64;  // of MeshParts, with its share of the table
  const std::int64_t edges = counts.all.edges, triangles = counts.all.triangles, squares = counts.all.quadrilaterals;
  std::int64_t bytes = edges * (2 * std::int64_t{sizeof(MeshEdge)} + block(kIndex * (counts.order - 1)) + kTableEntry);
  const auto add_faces = [&](Shape shape, std::int64_t number) {
    bytes += number * (2 * std::int64_t{sizeof(MeshFace)} + block(kIndex * reference::node_count(shape, counts.order)) +
                       block(kIndex * reference::info(shape).vertices) + kTableEntry);
  };
  add_faces(Shape::Triangle, triangles);
  add_faces(Shape::Quadrilateral, squares);
  for (std::size_t s = 0; s < kShapes; ++s) {
    const std::int64_t nodes = reference::node_count(static_cast<Shape>(s), counts.order);
    bytes += (counts.cells[s] + counts.others[s]) * 2 * (kIndex * nodes + std::int64_t{sizeof(std::int64_t)});
    bytes += counts.others[s] * nodes * (kIndex + std::int64_t{sizeof(std::array<double, 2>)});  // SurfaceNodes
  }
  // By vertex, its cells and those that are wanted.
  bytes += 2 * counts.all.vertices * block(80) +
           2 * 2 * 4 * std::int64_t{sizeof(std::size_t)} * counts.cells[static_cast<std::size_t>(Shape::Tetrahedron)];
  return bytes + counts.nodes() * std::int64_t{sizeof(NodeEntity)};
}

std::string cusps_sentence(const std::vector<Cusp>& cusps) {
  constexpr std::size_t kShown = 5;
  if (cusps.empty()) return "";
  std::string text;
  std::set<std::int64_t> cells;
  bool is_narrow = false;  // but there is some room
  for (std::size_t c = 0; c < cusps.size(); ++c) {
    const Cusp& cusp = cusps[c];
    cells.insert(cusp.cells.begin(), cusp.cells.end());
    is_narrow = is_narrow || cusp.angle > kNoRoom;
    if (c >= kShown) continue;
    std::array<char, 160> where{};
    std::snprintf(where.data(), where.size(), " meet at %.1f° near (%.4g, %.4g, %.4g)", cusp.angle, cusp.x[0],
                  cusp.x[1], cusp.x[2]);
    text += (c > 0 ? ", " : "") + cusp.sides + where.data();
  }
  if (cusps.size() > kShown) text += " and " + std::to_string(cusps.size() - kShown) + " more";
  const std::string place = cusps.size() == 1 ? "a cusp" : std::to_string(cusps.size()) + " cusps";
  return std::string(is_narrow ? "The model leaves hardly any room" : "The model leaves no room") +
         " for valid elements at " + place + ": " + text + "; " + counted(std::ssize(cells), "element") +
         (cells.size() == 1 ? " touches " : " touch ") + (cusps.size() == 1 ? "it." : "them.") +
         (is_narrow ? " Smaller elements hardly help." : " Smaller elements do not help.") +
         " Change the model there, for example leave a wall or a flat of some width, and export it again.";
}

}  // namespace varimesh
