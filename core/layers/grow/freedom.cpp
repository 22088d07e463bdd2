#include "core/layers/grow/freedom.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <set>

#include "core/base/index.h"
#include "core/layers/facet_table.h"
#include "core/layers/grow/outer_facets.h"

namespace varimesh::detail {
namespace {

using Vector = Eigen::Vector3d;

/// Two planes are the same if the sine of their angle is at most this.
constexpr double kSamePlane = 1e-4;
/// A periodic link is a translation if its pairs differ by at most this share of it.
constexpr double kSameShift = 1e-6;

}  // namespace

/// What lies around a vertex on the boundary.
struct Freedoms::Around {
  struct Face {
    Vector normal;
    std::set<int> entities;
  };
  std::vector<Face> faces;      ///< One for each plane.
  std::vector<Vector> borders;  ///< Directions of edges in which two entities of one plane meet.
  std::vector<Vector> lines;    ///< Directions of line elements inside a curved side.
  bool is_curved = false;
  bool is_on_wall = false;

  void add(const Vector& normal, int entity) {
    for (Face& face : faces)
      if (face.normal.cross(normal).norm() <= kSamePlane) {
        face.entities.insert(entity);
        return;
      }
    faces.push_back({normal, {entity}});
  }

  Freedom freedom(int dimension) const {
    Freedom all;
    all.count = dimension;
    for (int d = 0; d < dimension; ++d) all.along[at(d)] = Vector::Unit(d);
    if (faces.empty() && !is_curved) return all;
    const bool has_border = std::ranges::any_of(faces, [](const Face& face) { return face.entities.size() > 1; });
    if (is_curved || (has_border && borders.empty() && !is_on_wall)) return {};
    return dimension == 2 ? along_line() : borders.empty() ? along_planes() : along_borders();
  }

  /// The same on curved sides on which the vertex may move in these directions.
  Freedom freedom_on(const std::vector<Vector>& directions) const {
    if (lines.empty() || directions.empty()) return Freedom::in(directions);
    const bool is_straight =
        std::ranges::all_of(lines, [&](const Vector& line) { return line.cross(lines[0]).norm() <= kSamePlane; });
    return is_straight ? Freedom::in(std::span(lines).first(1)) : Freedom();
  }

 private:
  Freedom along_line() const {
    Freedom one;
    one.count = faces.size() == 1 ? 1 : 0;
    one.along[0] = faces[0].normal.cross(Vector(0, 0, 1)).normalized();
    return one;
  }

  Freedom along_borders() const {
    Freedom one;
    const auto is_along = [&](const Vector& other) { return other.cross(borders[0]).norm() <= kSamePlane; };
    const auto lies_in = [&](const Face& face) { return std::abs(face.normal.dot(borders[0])) <= kSamePlane; };
    one.count = std::ranges::all_of(borders, is_along) && std::ranges::all_of(faces, lies_in) ? 1 : 0;
    one.along[0] = borders[0];
    return one;
  }

  Freedom along_planes() const {
    Freedom found;
    if (faces.size() == 1) {
      found.count = 2;
      found.along[0] = faces[0].normal.unitOrthogonal();
      found.along[1] = faces[0].normal.cross(found.along[0]);
      return found;
    }
    const Vector line = faces[0].normal.cross(faces[1].normal).normalized();
    const bool share_a_line =
        std::ranges::all_of(faces, [&](const Face& face) { return std::abs(face.normal.dot(line)) <= kSamePlane; });
    found.count = share_a_line ? 1 : 0;
    found.along[0] = line;
    return found;
  }
};

Freedom Freedom::in(std::span<const Vector> directions) {
  Freedom freedom;
  freedom.count = static_cast<int>(directions.size());
  std::ranges::copy(directions, freedom.along.begin());
  return freedom;
}

Vector Freedom::project(const Vector& displacement) const {
  Vector sum = Vector::Zero();
  for (int d = 0; d < count; ++d) sum += along[at(d)].dot(displacement) * along[at(d)];
  return sum;
}

Freedoms::Freedoms(const HighOrderMesh& mesh, std::span<const OuterFacet> outer, const CurvedSides& sides) {
  find_masters(mesh);
  std::map<std::int32_t, Around> around;  // by the first of vertices that move alike
  std::map<std::vector<std::int32_t>, std::vector<const OuterFacet*>>
      at_sides;  // vertices of the plane, edges in space
  for (const OuterFacet& facet : outer) {
    const auto vertices = facet.corners();
    for (std::size_t v = 0; v < vertices.size(); ++v) {
      Around& here = around[master(vertices[v])];
      if (facet.is_wall)
        here.is_on_wall = true;
      else if (facet.is_plane)
        here.add(facet.normal, facet.entity);
      else
        here.is_curved = true;
      std::vector<std::int32_t> side{vertices[v]};
      if (mesh.dimension == 3) side.push_back(vertices[(v + 1) % vertices.size()]);
      std::ranges::sort(side);
      at_sides[side].push_back(&facet);
    }
  }
  for (const auto& [side, facets] : at_sides) {
    const bool is_rim = facets.size() == 1 && !facets[0]->is_wall;  // the end of an interface inside the mesh
    const bool is_border = mesh.dimension == 3 && facets.size() == 2 && !facets[0]->is_wall && !facets[1]->is_wall &&
                           facets[0]->entity != facets[1]->entity &&
                           facets[0]->normal.cross(facets[1]->normal).norm() <= kSamePlane;
    for (const std::int32_t vertex : side) {
      Around& here = around[master(vertex)];
      if (is_rim && !here.is_on_wall) stays_[at(master(vertex))] = 1;
      if (is_border) here.borders.push_back(Vector(point(mesh, side[1]) - point(mesh, side[0])).normalized());
    }
  }
  note_points_and_lines(mesh, around, sides);
  freedoms_.assign(mesh.node_count(), Around().freedom(mesh.dimension));
  for (std::size_t n = 0; n < mesh.node_count(); ++n) {
    const auto found = around.find(master_[n]);
    if (found != around.end())  // a vertex
      freedoms_[n] = sides.has(master_[n]) ? found->second.freedom_on(sides.directions(master_[n]))
                                           : found->second.freedom(mesh.dimension);
    if (stays_[at(master_[n])] != 0) freedoms_[n] = {};
  }
}

/// Points and lines inside the mesh, or inside a plane, stay. So do they on curved sides, but vertices may slide along
/// lines there that are straight, such as the seam of a cylinder.
void Freedoms::note_points_and_lines(const HighOrderMesh& mesh, std::map<std::int32_t, Around>& around,
                                     const CurvedSides& sides) {
  for (const ElementBlock& block : mesh.blocks) {
    const int dimension = reference::info(block.shape).dimension;
    if (dimension > mesh.dimension - 2) continue;
    const std::size_t stride = block.size() == 0 ? 1 : block.nodes.size() / block.size();
    for (std::size_t k = 0; k < block.nodes.size(); ++k) {
      if (k % stride > 1) continue;  // a line has two vertices
      const std::int32_t vertex = master(block.nodes[k]);
      Around& here = around[vertex];
      if (here.is_on_wall) continue;
      if (dimension == 1 && sides.has(vertex)) {
        const std::size_t first = k - k % stride;
        const Vector along = point(mesh, block.nodes[first + 1]) - point(mesh, block.nodes[first]);
        if (!sides.is_between(vertex)) here.lines.push_back(along.normalized());
      } else if (dimension == 0 || (here.faces.size() <= 1 && here.borders.empty())) {
        stays_[at(vertex)] = 1;
      }
    }
  }
}

void Freedoms::find_masters(const HighOrderMesh& mesh) {
  for (std::size_t n = 0; n < mesh.node_count(); ++n) master_.push_back(static_cast<std::int32_t>(n));
  stays_.assign(mesh.node_count(), 0);
  const auto first = [&](std::int32_t node) {
    while (master_[at(node)] != node) node = master_[at(node)];
    return node;
  };
  for (const PeriodicLink& link : mesh.periodic) {
    if (link.nodes.empty()) continue;
    const auto shift = [&](const std::pair<std::int32_t, std::int32_t>& pair) {
      return Vector(point(mesh, pair.first) - point(mesh, pair.second));
    };
    const Vector by = shift(link.nodes.front());
    const bool is_translation = std::ranges::all_of(
        link.nodes, [&](const auto& pair) { return (shift(pair) - by).norm() <= kSameShift * by.norm(); });
    for (const auto& [node, image] : link.nodes) {
      const auto [low, high] = std::minmax({first(node), first(image)});
      if (is_translation)
        master_[at(high)] = low;
      else
        stays_[at(node)] = stays_[at(image)] = 1;
    }
  }
  for (std::size_t n = 0; n < mesh.node_count(); ++n) {
    master_[n] = first(static_cast<std::int32_t>(n));
    if (stays_[n] != 0) stays_[at(master_[n])] = 1;
  }
}

}  // namespace varimesh::detail
