#include "core/layers/grow/columns.h"

#include <algorithm>
#include <map>
#include <set>
#include <string>

#include "core/base/index.h"
#include "core/layers/facet_table.h"
#include "core/layers/grow/model_normals.h"

namespace varimesh::detail {
namespace {

using Vector = Eigen::Vector3d;

/// The wall is smooth at a vertex if its mean normal differs from that of each element by less: the cosine of 40°.
constexpr double kSmooth = 0.766;
/// A column leans by at most this against an element of the wall: the cosine of 89°.
constexpr double kLeastVisible = 0.02;
/// A column may be longer where it leans, so that the layer keeps its thickness, but not by more than 1 over this. At
/// the trailing edge of an aerofoil it is some seven times as long as the layer is thick.
constexpr double kMostLean = 0.1;
/// The edge between two columns keeps at least this share of its length at their tops.
constexpr double kLeastShare = 0.35;
/// A column is longer than its neighbour by at most this share of the distance between them.
constexpr double kSteepest = 0.4;
/// What a column keeps of its length if there is no room for it.
constexpr double kShortened = 0.6;

/// The direction with the largest smallest dot product with the normals, among those that are free: a step towards the
/// normal that it sees least, again and again, each shorter than the last.
Vector most_visible(const std::vector<Vector>& normals, const Freedom& freedom) {
  Vector sum = Vector::Zero();
  for (const Vector& normal : normals) sum += normal;
  Vector direction = freedom.project(sum).normalized();
  const auto seen = [&](const Vector& d) {
    return std::ranges::min_element(normals, {}, [&](const Vector& normal) { return normal.dot(d); });
  };
  if (seen(direction)->dot(direction) > kSmooth) return direction;
  Vector best = direction;
  constexpr int kSteps = 400;
  for (int step = 0; step < kSteps; ++step) {
    direction = (direction + freedom.project(*seen(direction)) / (2.0 + step)).normalized();
    if (seen(direction)->dot(direction) > seen(best)->dot(best)) best = direction;
  }
  return best;
}

double least_seen(const std::vector<Vector>& normals, const Vector& direction) {
  double least = 1;
  for (const Vector& normal : normals) least = std::min(least, normal.dot(direction));
  return least;
}

}  // namespace

Expected<GrowthColumns> GrowthColumns::find(const CheckedMesh& checked, std::span<const WallElement> walls,
                                            const Freedoms& freedoms, double thickness, const Association* model) {
  const HighOrderMesh& mesh = checked.mesh;
  const Cells elements(mesh, mesh.dimension - 1), cells(mesh, mesh.dimension);
  const ModelNormals of_model(mesh, elements, model);
  std::map<Shape, FacetTable> tables;
  std::map<std::int32_t, std::vector<Vector>> normals;  // by the first of the vertices that are images of each other
  std::set<std::int32_t> vertices;
  std::set<std::pair<std::int32_t, std::int32_t>> edges;
  for (const WallElement& wall : walls) {
    const auto nodes = elements.nodes(at(wall.element));
    const Shape shape = elements.shape(at(wall.element));
    const auto cell = std::ranges::upper_bound(checked.facets.first, wall.facet) - checked.facets.first.begin() - 1;
    const auto of_cell = cells.nodes(at(cell));
    Vector inward = Vector::Zero();
    const int corners = reference::info(cells.shape(at(cell))).vertices, count = reference::info(shape).vertices;
    for (int v = 0; v < corners; ++v) inward += point(mesh, of_cell[at(v)]) / corners;
    for (int v = 0; v < count; ++v) inward -= point(mesh, nodes[at(v)]) / count;
    const auto [table, is_new] = tables.try_emplace(shape, shape, mesh.order, mesh.dimension);
    const std::vector<Vector> at_nodes = table->second.normals(mesh, nodes, inward);
    for (int v = 0; v < count; ++v) {
      normals[freedoms.master(nodes[at(v)])].push_back(of_model.at(wall.element, nodes[at(v)], at_nodes[at(v)]));
      vertices.insert(nodes[at(v)]);
    }
    for (const auto& edge : reference::info(shape).edges)
      edges.insert(std::minmax(nodes[at(edge[0])], nodes[at(edge[1])]));
  }
  GrowthColumns found;
  found.column_of_.assign(mesh.node_count(), -1);
  for (const std::int32_t vertex : vertices) {
    const std::vector<Vector>& seen = normals.at(freedoms.master(vertex));
    const Vector direction = most_visible(seen, freedoms.of(vertex));
    const double least = direction.allFinite() ? least_seen(seen, direction) : -1;
    if (!(least >= kLeastVisible))
      return bad_input("No layer can grow at node " + std::to_string(mesh.node_numbers[at(vertex)]) + " of the wall. " +
                       (freedoms.of(vertex).count == mesh.dimension
                            ? "Elements of the wall around it face in opposite directions."
                            : "The wall ends there at a boundary or an interface on which the node cannot follow the "
                              "layer: it has a corner there, is periodic by a rotation, goes on in the direction of "
                              "the wall, or its shape there is not clear from the mesh or the model. If it goes on, "
                              "name it as a wall too. If the mesh is a straight one of a curved boundary, curve it "
                              "first."));
    const double asked = thickness / std::max(least, kMostLean);
    found.column_of_[at(vertex)] = static_cast<std::int32_t>(found.columns_.size());
    found.columns_.push_back({vertex, direction, least, asked, asked});
  }
  for (std::size_t c = 0; c < found.columns_.size(); ++c)
    if (const std::int32_t master = found.column_of_[at(freedoms.master(found.columns_[c].vertex))];
        master >= 0 && at(master) != c)
      found.images_.emplace_back(master, static_cast<std::int32_t>(c));
  for (const auto& [a, b] : edges)
    found.edges_.push_back({found.column_of_[at(a)], found.column_of_[at(b)], Vector(point(mesh, b) - point(mesh, a))});
  found.limit();
  return found;
}

const GrowthColumn* GrowthColumns::at_node(std::int32_t node) const {
  const std::int32_t column = column_of_[at(node)];
  return column < 0 ? nullptr : &columns_[at(column)];
}

void GrowthColumns::limit() {
  constexpr int kMostRounds = 1000;
  constexpr double kRounding = 1e-6;
  for (int round = 0, changed = 1; changed > 0 && round < kMostRounds; ++round) {
    changed = 0;
    const auto lower = [&](GrowthColumn& column, double length) {
      if (column.length <= length * (1 + kRounding)) return;
      column.length = length;
      ++changed;
    };
    for (const auto& [a, b] : images_) {
      lower(columns_[at(a)], columns_[at(b)].length);
      lower(columns_[at(b)], columns_[at(a)].length);
    }
    for (const Edge& edge : edges_) {
      GrowthColumn &a = columns_[at(edge.from)], &b = columns_[at(edge.to)];
      const double nearer = (a.length * a.direction - b.length * b.direction).dot(edge.along);
      const double room = (1 - kLeastShare) * edge.along.squaredNorm();
      if (nearer > room) {
        const double share = room / nearer;
        lower(a, share * a.length);
        lower(b, share * b.length);
      }
      const double steepest = kSteepest * edge.along.norm();
      lower(a, b.length * a.asked / b.asked + steepest);
      lower(b, a.length * b.asked / a.asked + steepest);
    }
  }
}

void GrowthColumns::cap(const std::function<double(std::int32_t vertex)>& longest) {
  for (GrowthColumn& column : columns_) column.length = std::min(column.length, longest(column.vertex));
  limit();
}

void GrowthColumns::shorten(std::span<const std::int32_t> vertices) {
  for (const std::int32_t vertex : vertices)
    if (const std::int32_t column = column_of_[at(vertex)]; column >= 0) columns_[at(column)].length *= kShortened;
  limit();
}

const GrowthColumn& GrowthColumns::shortest() const {
  return *std::ranges::min_element(columns_, {}, [](const GrowthColumn& c) { return c.length / c.asked; });
}

}  // namespace varimesh::detail
