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
#include "core/layers/grow/curved_sides.h"
#include "core/layers/grow/elastic_move.h"
#include "core/layers/grow/freedom.h"
#include "core/layers/grow/grown_mesh.h"
#include "core/layers/grow/outer_facets.h"
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
/// If there is no time to move cells away, columns have at most this share of the height of the cells at the wall.
constexpr double kHastyShare = 0.3;
constexpr int kMostHastyAttempts = 6;

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

/// Tries columns, shorter ones each time, until no cell is spoilt.
class Growth {
 public:
  Growth(Turned& turned, std::span<const detail::WallElement> walls, const detail::CurvedSides& sides,
         const detail::Freedoms& freedoms, detail::GrowthColumns columns, double thickness)
      : turned_(turned),
        mesh_(turned.checked.mesh),
        walls_(walls),
        sides_(sides),
        columns_(std::move(columns)),
        thickness_(thickness),
        body_(mesh_, freedoms),
        nearest_(mesh_, columns_) {}

  /// Cells beyond the layer move away. The team's token may interrupt this.
  Expected<GrownLayer> at_leisure(const Team& team) {
    valid_ = certified(mesh_, team);
    for (int attempt = 0; has_room(); ++attempt) {
      auto moved = body_.move(pushes(), team.stop());
      Nodes spoilt_vertices = std::move(moved.crushed);
      if (spoilt_vertices.empty()) {
        auto made = make(std::move(moved.displacements));
        if (!made) return tl::unexpected(made.error());
        spoilt_vertices = spoilt(*made, mesh_, valid_, team);
        if (spoilt_vertices.empty() || attempt >= kMostAttempts) return grown(std::move(*made), team);
      }
      columns_.shorten(nearest_.to(spoilt_vertices));
    }
    return no_room();
  }

  /// Only the vertices of the walls move, so the layer is thinner than the cells there.
  Expected<GrownLayer> in_haste(const Team& team) {
    const std::vector<double> heights = body_.heights();
    columns_.cap([&](std::int32_t vertex) { return kHastyShare * heights[at(vertex)]; });
    valid_ = certified(mesh_, team);
    for (int attempt = 0; attempt < kMostHastyAttempts && has_room(); ++attempt) {
      std::vector<Eigen::Vector3d> displacements(mesh_.node_count(), Eigen::Vector3d::Zero());
      for (const detail::Push& push : pushes()) displacements[at(push.vertex)] = push.by;
      auto made = make(std::move(displacements));
      if (!made) return tl::unexpected(made.error());
      const Nodes spoilt_vertices = spoilt(*made, mesh_, valid_, team);
      if (spoilt_vertices.empty()) {
        GrownLayer layer = grown(std::move(*made), team);
        layer.sentence += " The time limit passed while it grew, so no cells moved away";
        layer.sentence += layer.full_share < 1 ? ", and it is thinner than it could be." : ".";
        return layer;
      }
      columns_.shorten(nearest_.to(spoilt_vertices));
    }
    throw Interrupted();
  }

 private:
  bool has_room() const { return columns_.shortest().length > kThinnest * columns_.shortest().asked; }

  std::vector<detail::Push> pushes() const {
    std::vector<detail::Push> found;
    for (const detail::GrowthColumn& column : columns_.columns())
      found.push_back({column.vertex, column.length * column.direction});
    return found;
  }

  Expected<HighOrderMesh> make(std::vector<Eigen::Vector3d> displacements) const {
    for (std::size_t n = 0; n < displacements.size(); ++n) {
      const auto node = static_cast<std::int32_t>(n);
      if (!sides_.has(node) || displacements[n].isZero(0)) continue;
      const Eigen::Vector3d from = detail::point(mesh_, node);
      displacements[n] = sides_.nearest(node, from + displacements[n]) - from;
    }
    return detail::grown_mesh(turned_.checked, walls_, sides_, displacements);
  }

  GrownLayer grown(HighOrderMesh made, const Team& team) {
    GrownLayer layer;
    layer.mesh = std::move(made);
    describe(mesh_, walls_, columns_, thickness_, layer);
    turned_.turn_back(layer.mesh, team);
    return layer;
  }

  tl::unexpected<Error> no_room() const {
    return bad_input("There is no room for a layer at node " +
                     std::to_string(mesh_.node_numbers[at(columns_.shortest().vertex)]) +
                     " of the wall. Make the cells there larger, or leave that part out of the wall.");
  }

  Turned& turned_;
  const HighOrderMesh& mesh_;
  std::span<const detail::WallElement> walls_;
  const detail::CurvedSides& sides_;
  detail::GrowthColumns columns_;
  double thickness_;
  const detail::ElasticMove body_;
  const NearestOnWall nearest_;
  std::vector<char> valid_;  ///< By cell: whether it is certified valid as it came.
};

/// Whether there is time to move cells away.
enum class Pace : std::uint8_t { Leisure, Haste };

Expected<GrownLayer> grow(const CheckedMesh& mesh, std::span<const std::string> names, double thickness,
                          const Association* model, Pace pace, const Team& team) {
  Turned turned(mesh, team);
  const CheckedMesh& checked = turned.checked;
  const auto walls = detail::find_walls(checked.mesh, checked.facets, names);
  if (!walls) return tl::unexpected(walls.error());
  const std::vector<detail::OuterFacet> outer = detail::outer_facets(checked, *walls);
  const detail::CurvedSides sides(checked, outer, model, team);
  const detail::Freedoms freedoms(checked.mesh, outer, sides);
  auto columns = detail::GrowthColumns::find(checked, *walls, freedoms, thickness, model);
  if (!columns) return tl::unexpected(columns.error());
  Growth growth(turned, *walls, sides, freedoms, std::move(*columns), thickness);
  return pace == Pace::Leisure ? growth.at_leisure(team) : growth.in_haste(team);
}

}  // namespace

Expected<GrownLayer> grow_layer(const CheckedMesh& mesh, std::span<const std::string> walls, double thickness,
                                const Team& team, const Association* model, const std::function<bool()>& asked) {
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
  try {
    team.run([&] { grown = grow(mesh, walls, thickness, model, Pace::Leisure, team); });
  } catch (const Interrupted&) {
    if (team.stop()->reason() != StopToken::Reason::TimeLimit) throw;
    const StopToken without_limit(asked);
    Team without = team.without_stop();
    without.set_stop(&without_limit);
    without.run([&] { grown = grow(mesh, walls, thickness, model, Pace::Haste, without); });
  }
  if (grown && mesh.plane) mesh.plane->put_back(grown->mesh);
  return grown;
}

}  // namespace varimesh
