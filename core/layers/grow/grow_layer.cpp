#include "core/layers/grow/grow_layer.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <iomanip>
#include <sstream>
#include <utility>
#include <vector>

#include "core/base/index.h"
#include "core/layers/facet_table.h"
#include "core/layers/grow/columns.h"
#include "core/layers/grow/elastic_move.h"
#include "core/layers/grow/freedom.h"
#include "core/layers/grow/grown_mesh.h"
#include "core/layers/walls.h"
#include "core/validity/certifier.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

using Nodes = std::vector<std::int32_t>;

constexpr int kMostAttempts = 30;
/// A layer that is thinner than this share of what was asked for is none.
constexpr double kThinnest = 1e-3;
/// A thickness below this share of the mesh's size is a rounding error.
constexpr double kRounding = 1e-13;
/// A layer has its full thickness if it has this share of it.
constexpr double kFull = 0.95;

/// The mesh with all cells numbered counter-clockwise, and which of them came otherwise.
struct Turned {
  CheckedMesh checked;
  std::vector<char> clockwise;  ///< By cell; empty if none did.

  Turned(const CheckedMesh& of, const Team& team)
      : checked(of), clockwise(detail::clockwise_cells(of.mesh, of.facets, team)) {
    if (clockwise.empty()) return;
    detail::turn_cells(checked.mesh, clockwise, team);
    checked.facets = facets(checked.mesh, team);
  }

  /// Turns the cells back in a mesh with more cells at its end, and those cells as their neighbours.
  void turn_back(HighOrderMesh& mesh, const Team& team) {
    if (clockwise.empty()) return;
    const Facets around = facets(mesh, team);
    const std::size_t had = clockwise.size();
    for (std::size_t cell = had; cell + 1 < around.first.size(); ++cell) {
      char is_clockwise = 0;
      for (std::int32_t facet = around.first[cell]; facet < around.first[cell + 1]; ++facet)
        if (const std::int32_t beside = around.neighbour[at(facet)]; beside >= 0 && at(beside) < had)
          is_clockwise = clockwise[at(beside)];
      clockwise.push_back(is_clockwise);
    }
    detail::turn_cells(mesh, clockwise, team);
  }
};

std::vector<char> certified(const HighOrderMesh& mesh, const Team& team) {
  const Certifier certifier(mesh, {}, team);
  std::vector<Certificate> certificates(certifier.cells());
  certifier.certify(mesh.coordinates, certificates, team);
  std::vector<char> valid;
  for (const Certificate& certificate : certificates) valid.push_back(certificate.is_valid() ? 1 : 0);
  return valid;
}

/// Finds the vertex of a wall that is nearest to each vertex, along edges.
class NearestOnWall {
 public:
  NearestOnWall(const HighOrderMesh& mesh, const detail::GrowthColumns& columns) : nearest_(mesh.node_count(), -1) {
    std::vector<Nodes> around(mesh.node_count());
    const Cells cells(mesh, mesh.dimension);
    for (std::size_t cell = 0; cell < cells.count(); ++cell)
      for (const auto& edge : reference::info(cells.shape(cell)).edges) {
        const std::int32_t a = cells.nodes(cell)[at(edge[0])], b = cells.nodes(cell)[at(edge[1])];
        around[at(a)].push_back(b);
        around[at(b)].push_back(a);
      }
    Nodes found;
    for (const detail::GrowthColumn& column : columns.columns()) found.push_back(column.vertex);
    for (const std::int32_t vertex : found) nearest_[at(vertex)] = vertex;
    for (std::size_t k = 0; k < found.size(); ++k)
      for (const std::int32_t beyond : around[at(found[k])])
        if (nearest_[at(beyond)] < 0) {
          nearest_[at(beyond)] = nearest_[at(found[k])];
          found.push_back(beyond);
        }
  }

  /// Without repetitions.
  Nodes to(const Nodes& vertices) const {
    Nodes found;
    for (const std::int32_t vertex : vertices)
      if (nearest_[at(vertex)] >= 0) found.push_back(nearest_[at(vertex)]);
    std::ranges::sort(found);
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
  }

 private:
  Nodes nearest_;
};

/// The vertices, in the mesh as it came, of cells that are not certified although they are new, or were certified
/// before.
Nodes spoilt(const HighOrderMesh& grown, const HighOrderMesh& came, const std::vector<char>& valid_before,
             const Team& team) {
  const std::vector<char> valid = certified(grown, team);
  const Cells cells(grown, grown.dimension), old(came, came.dimension);
  Nodes vertices;
  for (std::size_t cell = 0; cell < cells.count(); ++cell) {
    const bool is_new = cell >= old.count();
    if (valid[cell] != 0 || (!is_new && valid_before[cell] == 0)) continue;
    const auto nodes = is_new ? cells.nodes(cell) : old.nodes(cell);
    for (int v = 0; v < reference::info(cells.shape(cell)).vertices; ++v)
      if (at(nodes[at(v)]) < came.node_count()) vertices.push_back(nodes[at(v)]);
  }
  std::ranges::sort(vertices);
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  return vertices;
}

/// The area, or length, of a straight-sided element.
double area(const HighOrderMesh& mesh, Shape shape, std::span<const std::int32_t> nodes) {
  const auto edge = [&](int to) {
    return Eigen::Vector3d(detail::point(mesh, nodes[at(to)]) - detail::point(mesh, nodes[0]));
  };
  if (shape == Shape::Line) return edge(1).norm();
  const double half = edge(1).cross(edge(2)).norm() / 2;
  return shape == Shape::Triangle ? half : half + edge(2).cross(edge(3)).norm() / 2;
}

void describe(const HighOrderMesh& mesh, std::span<const detail::WallElement> walls,
              const detail::GrowthColumns& columns, double thickness, GrownLayer& grown) {
  const Cells elements(mesh, mesh.dimension - 1);
  // Along the normal of the element that leans most against the column.
  const auto share = [&](const detail::GrowthColumn& column) {
    return std::min(1.0, column.length * column.seen / thickness);
  };
  double full = 0, whole = 0;
  for (const detail::WallElement& wall : walls) {
    const auto nodes = elements.nodes(at(wall.element));
    const Shape shape = elements.shape(at(wall.element));
    const double here = area(mesh, shape, nodes);
    whole += here;
    if (std::ranges::all_of(nodes.first(at(reference::info(shape).vertices)),
                            [&](std::int32_t node) { return share(*columns.at_node(node)) >= kFull; }))
      full += here;
  }
  grown.full_share = whole > 0 ? full / whole : 0;
  for (const detail::GrowthColumn& column : columns.columns())
    grown.shares[mesh.node_numbers[at(column.vertex)]] = share(column);
  const auto [least, most] = std::ranges::minmax_element(columns.columns(), {}, share);
  grown.thickness = {share(*least) * thickness, share(*most) * thickness};
  std::ostringstream text;
  text << "A layer of thickness " << thickness << " was grown on " << walls.size() << " elements of the wall. ";
  if (share(*least) >= kFull)
    text << "It has this thickness everywhere.";
  else
    text << std::setprecision(3) << "It has this thickness on " << 100 * grown.full_share
         << " % of their area. Elsewhere it is thinner, for want of room or because the wall is sharp, and thinnest at "
            "node "
         << mesh.node_numbers[at(least->vertex)] << ", with " << grown.thickness[0] << ".";
  grown.sentence = text.str();
}

Expected<GrownLayer> grow(Turned& turned, std::span<const std::string> names, double thickness,
                          const Association* model, const Team& team) {
  const CheckedMesh& checked = turned.checked;
  const HighOrderMesh& mesh = checked.mesh;
  const auto walls = detail::find_walls(mesh, checked.facets, names);
  if (!walls) return tl::unexpected(walls.error());
  const detail::Freedoms freedoms(checked, *walls);
  auto columns = detail::GrowthColumns::find(checked, *walls, freedoms, thickness, model);
  if (!columns) return tl::unexpected(columns.error());
  const detail::ElasticMove body(mesh, freedoms);
  const NearestOnWall nearest(mesh, *columns);
  const std::vector<char> valid = certified(mesh, team);
  for (int attempt = 0; columns->shortest().length > kThinnest * columns->shortest().asked; ++attempt) {
    std::vector<detail::Push> pushes;
    for (const detail::GrowthColumn& column : columns->columns())
      pushes.push_back({column.vertex, column.length * column.direction});
    auto moved = body.move(pushes, team.stop());
    Nodes spoilt_vertices = std::move(moved.crushed);
    if (spoilt_vertices.empty()) {
      auto made = detail::grown_mesh(checked, *walls, *columns, moved.displacements);
      if (!made) return tl::unexpected(made.error());
      spoilt_vertices = spoilt(*made, mesh, valid, team);
      if (spoilt_vertices.empty() || attempt >= kMostAttempts) {
        GrownLayer grown;
        grown.mesh = std::move(*made);
        describe(mesh, *walls, *columns, thickness, grown);
        turned.turn_back(grown.mesh, team);
        return grown;
      }
    }
    columns->shorten(nearest.to(spoilt_vertices));
  }
  return bad_input("There is no room for a layer at node " +
                   std::to_string(mesh.node_numbers[at(columns->shortest().vertex)]) +
                   " of the wall. Make the cells there larger, or leave that part out of the wall.");
}

}  // namespace

Expected<GrownLayer> grow_layer(const CheckedMesh& mesh, std::span<const std::string> walls, double thickness,
                                const Team& team, const Association* model) {
  if (mesh.facets.first.empty())
    return bad_input("The mesh is a surface in space. Layers can be made in meshes of the plane and of space.");
  double size = 0;  // of the bounding box
  for (std::size_t c = 0; c < 3; ++c) {
    double least = mesh.mesh.coordinates[c], most = least;
    for (std::size_t n = 0; n < mesh.mesh.node_count(); ++n) {
      least = std::min(least, mesh.mesh.coordinates[3 * n + c]);
      most = std::max(most, mesh.mesh.coordinates[3 * n + c]);
    }
    size = std::max(size, most - least);
  }
  if (!(thickness > kRounding * size && thickness < size)) {
    std::ostringstream text;
    text << "A layer of thickness " << thickness << " cannot grow in a mesh of size " << size
         << ". Give the thickness in the mesh's unit of length.";
    return bad_option(text.str());
  }
  Expected<GrownLayer> grown;
  team.run([&] {
    Turned turned(mesh, team);
    grown = grow(turned, walls, thickness, model, team);
  });
  if (grown && mesh.plane) mesh.plane->put_back(grown->mesh);
  return grown;
}

}  // namespace varimesh
