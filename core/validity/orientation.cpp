// The sense of cells relative to their neighbours, and the volume that the outer facets of joined cells enclose.
#include "core/validity/orientation.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <map>

#include "core/mesh/bounding_box.h"
#include "core/reference/basis.h"
#include "core/reference/quadrature.h"
#include "core/validity/cell_batches.h"

namespace varimesh::detail {
namespace {

constexpr std::size_t kCellsPerTask = 4096, kFacetsPerTask = 256;
/// How far rounding may have moved a vertex, in units of the cell's longest edge from its first vertex.
constexpr double kRounding = 1e-14;

// ---------------------------------------------------------------------------------------------------------------------
// The signs of straight-sided cells
// ---------------------------------------------------------------------------------------------------------------------

/// Gradients of the straight-sided cell's basis at the centre of the reference cell: vertices × dimension.
Eigen::MatrixXd centre_gradients(Shape shape, int dimension) {
  const reference::ShapeInfo& cell = reference::info(shape);
  reference::Points centre = reference::Points::Zero(1, dimension);
  for (int v = 0; v < cell.vertices; ++v)
    for (int c = 0; c < dimension; ++c)
      centre(0, c) += cell.vertex[static_cast<std::size_t>(v)][static_cast<std::size_t>(c)] / cell.vertices;
  const auto gradients = reference::basis_gradients(shape, 1, reference::NodeSet::Equispaced, dimension, centre);
  Eigen::MatrixXd result(cell.vertices, dimension);
  for (int r = 0; r < dimension; ++r) result.col(r) = gradients[static_cast<std::size_t>(r)].row(0).transpose();
  return result;
}

/// The sign of det ∇χ_L at the centre of the straight-sided cell with these vertices: −1 or 1, or 0 if it is flat
/// there, so that the sign is only rounding.
std::int8_t centre_sign(const HighOrderMesh& mesh, const std::int32_t* nodes, const Eigen::MatrixXd& gradients) {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  const int d = mesh.dimension;
  matrix.topLeftCorner(d, d).setZero();
  double longest = 0;
  for (Eigen::Index v = 0; v < gradients.rows(); ++v)
    for (int c = 0; c < d; ++c) {
      const double x = mesh.coordinates[3 * static_cast<std::size_t>(nodes[v]) + static_cast<std::size_t>(c)] -
                       mesh.coordinates[3 * static_cast<std::size_t>(nodes[0]) + static_cast<std::size_t>(c)];
      longest = std::max(longest, std::abs(x));
      for (int r = 0; r < d; ++r) matrix(c, r) += x * gradients(v, r);
    }
  const Eigen::Vector3d u = matrix.col(0), v = matrix.col(1), w = matrix.col(2);
  const double jacobian = u.dot(v.cross(w));
  // The derivatives of the determinant with respect to the entries are the cofactors.
  const double cofactors = v.cross(w).lpNorm<1>() + w.cross(u).lpNorm<1>() + u.cross(v).lpNorm<1>();
  if (!(std::abs(jacobian) > kRounding * longest * cofactors)) return 0;
  return static_cast<std::int8_t>(jacobian < 0 ? -1 : 1);
}

// ---------------------------------------------------------------------------------------------------------------------
// Joined cells and their senses
// ---------------------------------------------------------------------------------------------------------------------

/// The vertices of a cell's facet; unused entries are −1.
std::array<std::int32_t, 4> facet_vertices(const Cells& cells, std::size_t cell, std::size_t facet) {
  const auto nodes = cells.nodes(cell);
  std::array<std::int32_t, 4> vertices{-1, -1, -1, -1};
  const auto& local = reference::info(cells.shape(cell)).facets[facet].vertices;
  for (std::size_t k = 0; k < local.size() && local[k] >= 0; ++k)
    vertices[k] = nodes[static_cast<std::size_t>(local[k])];
  return vertices;
}

/// Whether the cells on both sides of a facet of `cell` are numbered in the same sense. Each lists the facet's vertices
/// counter-clockwise as seen from outside, so the other then lists them in reverse.
bool agree(const Cells& cells, const Facets& facets, std::size_t cell, std::int32_t facet) {
  const auto index = static_cast<std::size_t>(facet);
  const auto other = static_cast<std::size_t>(facets.neighbour[index]);
  const auto first = facet_vertices(cells, cell, static_cast<std::size_t>(facet - facets.first[cell]));
  const auto second =
      facet_vertices(cells, other, static_cast<std::size_t>(facets.opposite[index] - facets.first[other]));
  const auto count = static_cast<std::size_t>(std::ranges::find(first, -1) - first.begin());
  const auto same = static_cast<std::size_t>(std::ranges::find(second, first[0]) - second.begin());
  // Two vertices have no order round the facet, but a direction along it.
  return count == 2 ? same == 1 : second[(same + 1) % count] == first[count - 1];
}

// ---------------------------------------------------------------------------------------------------------------------
// The volume that facets enclose
// ---------------------------------------------------------------------------------------------------------------------

/// What a facet contributes to the volume that is enclosed: ∫ x · n / d over the curved facet, by Gauss's theorem. In
/// the plane, ½ ∫ x dy − y dx.
class FacetVolume {
 public:
  FacetVolume(const HighOrderMesh& mesh, const Cells& cells) : mesh_(mesh), cells_(cells) {
    for (const Cells::Range& range : cells.ranges())
      for (const reference::Facet& facet : reference::info(range.block->shape).facets)
        if (!tables_.contains(facet.shape)) tables_.emplace(facet.shape, make_table(facet.shape));
  }

  /// Of a facet of a cell, with places relative to `origin`.
  double of(std::size_t cell, int facet, const Eigen::RowVector3d& origin) const {
    const Shape shape = cells_.shape(cell);
    const Table& table = tables_.at(reference::info(shape).facets[static_cast<std::size_t>(facet)].shape);
    const auto nodes = cells_.nodes(cell);
    const std::vector<int>& local = reference::facet_nodes(shape, mesh_.order, facet);
    Eigen::MatrixX3d x(static_cast<Eigen::Index>(local.size()), 3);
    for (std::size_t n = 0; n < local.size(); ++n) {
      const auto node = static_cast<std::size_t>(nodes[static_cast<std::size_t>(local[n])]);
      x.row(static_cast<Eigen::Index>(n)) =
          Eigen::Map<const Eigen::RowVector3d>(mesh_.coordinates.data() + 3 * node) - origin;
    }
    const Eigen::MatrixX3d place = table.values * x, along = table.gradients[0] * x;
    const Eigen::MatrixX3d across = mesh_.dimension == 3 ? Eigen::MatrixX3d(table.gradients[1] * x) : place;
    double sum = 0;
    for (Eigen::Index q = 0; q < table.weights.size(); ++q) {
      const Eigen::RowVector3d u = along.row(q), v = across.row(q);
      const double density = mesh_.dimension == 3 ? place.row(q).dot(u.cross(v)) : v[0] * u[1] - v[1] * u[0];
      sum += table.weights[q] * density / mesh_.dimension;
    }
    return sum;
  }

 private:
  struct Table {
    Eigen::VectorXd weights;
    Eigen::MatrixXd values;                  // points × nodes
    std::vector<Eigen::MatrixXd> gradients;  // by direction, the same
  };

  Table make_table(Shape facet) const {
    // x has degree P in each direction; one of its two derivatives has P − 1.
    const reference::Quadrature rule = reference::quadrature(facet, mesh_.order, 3 * mesh_.order - 1);
    constexpr auto kNodes = reference::NodeSet::Equispaced;
    Table table{rule.weights, reference::basis_values(facet, mesh_.order, kNodes, mesh_.dimension, rule.points), {}};
    for (const auto& gradient : reference::basis_gradients(facet, mesh_.order, kNodes, mesh_.dimension, rule.points))
      table.gradients.emplace_back(gradient);
    return table;
  }

  const HighOrderMesh& mesh_;
  const Cells& cells_;
  std::map<Shape, Table> tables_;
};

/// Visits the cells that are joined with this one, which begins a new group.
void join(const Cells& cells, const Facets& facets, std::size_t start, std::span<const std::int8_t> signs,
          JoinedCells& joined) {
  const auto group = static_cast<std::int32_t>(joined.groups.size());
  JoinedCells::Group& found = joined.groups.emplace_back();
  std::vector<std::int32_t> visited{static_cast<std::int32_t>(start)};
  joined.group[start] = group;
  joined.sense[start] = 1;
  for (std::size_t next = 0; next < visited.size(); ++next) {
    const auto cell = static_cast<std::size_t>(visited[next]);
    found.is_upright &= joined.sense[cell] > 0 && signs[cell] > 0;
    for (std::int32_t f = facets.first[cell]; f < facets.first[cell + 1]; ++f) {
      const std::int32_t other = facets.neighbour[static_cast<std::size_t>(f)];
      if (other < 0) continue;
      const auto neighbour = static_cast<std::size_t>(other);
      const auto wanted =
          static_cast<std::int8_t>(agree(cells, facets, cell, f) ? joined.sense[cell] : -joined.sense[cell]);
      if (joined.sense[neighbour] != 0 && joined.sense[neighbour] != wanted) found.is_consistent = false;
      if (joined.sense[neighbour] != 0) continue;
      joined.sense[neighbour] = wanted;
      joined.group[neighbour] = group;
      visited.push_back(other);
    }
  }
}

/// All facets for which is_wanted(facet's index in Facets) holds.
template <class IsWanted>
std::vector<CellFacet> facets_of(const Cells& cells, const IsWanted& is_wanted) {
  std::vector<CellFacet> found;
  std::size_t index = 0;
  for (std::size_t cell = 0; cell < cells.count(); ++cell)
    for (std::size_t f = 0; f < reference::info(cells.shape(cell)).facets.size(); ++f, ++index)
      if (is_wanted(index)) found.push_back({static_cast<std::int32_t>(cell), static_cast<int>(f)});
  return found;
}

}  // namespace

// ---------------------------------------------------------------------------------------------------------------------
// What the header declares
// ---------------------------------------------------------------------------------------------------------------------

std::vector<std::int8_t> centre_signs(const HighOrderMesh& mesh, const Team& team) {
  const auto gradients = tables_for_cells<Eigen::MatrixXd>(
      mesh, [&](Shape shape, int) { return centre_gradients(shape, mesh.dimension); });
  const std::vector<CellBatch> batches = cell_batches(mesh, [](const ElementBlock&) { return kCellsPerTask; });
  std::vector<std::int8_t> signs(mesh.element_count(mesh.dimension));
  team.for_each(static_cast<std::int32_t>(batches.size()), 1, [&](std::int32_t b) {
    const CellBatch& batch = batches[static_cast<std::size_t>(b)];
    const Eigen::MatrixXd& gradient = gradients.at({batch.block->shape, batch.block->order});
    for (std::size_t i = 0; i < batch.count; ++i) signs[batch.cell + i] = centre_sign(mesh, batch.nodes(i), gradient);
  });
  return signs;
}

bool all_agree(const Cells& cells, const Facets& facets, const Team& team) {
  std::atomic<bool> yes{true};
  team.for_ranges(cells.count(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t cell = begin; cell < end && yes.load(std::memory_order_relaxed); ++cell)
      for (std::int32_t f = facets.first[cell]; f < facets.first[cell + 1]; ++f)
        if (facets.opposite[static_cast<std::size_t>(f)] > f && !agree(cells, facets, cell, f))
          yes.store(false, std::memory_order_relaxed);
  });
  return yes;
}

JoinedCells join_cells(const Cells& cells, const Facets& facets, std::span<const std::int8_t> signs) {
  JoinedCells joined;
  joined.group.resize(cells.count());
  joined.sense.resize(cells.count());
  for (std::size_t cell = 0; cell < cells.count(); ++cell)
    if (joined.sense[cell] == 0) join(cells, facets, cell, signs, joined);
  return joined;
}

std::vector<double> facet_volumes(const HighOrderMesh& mesh, const Cells& cells, std::span<const CellFacet> facets,
                                  const std::array<double, 3>& origin, const Team& team) {
  const FacetVolume volume(mesh, cells);
  const Eigen::RowVector3d from(origin[0], origin[1], origin[2]);
  std::vector<double> volumes(facets.size());
  team.for_ranges(facets.size(), kFacetsPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      volumes[i] = volume.of(static_cast<std::size_t>(facets[i].cell), facets[i].facet, from);
  });
  return volumes;
}

std::array<double, 3> centre(const BoundingBox& box) {
  std::array<double, 3> middle{};
  for (std::size_t c = 0; c < 3 && box.low[c] <= box.high[c]; ++c) middle[c] = box.low[c] / 2 + box.high[c] / 2;
  return middle;
}

double orientation(const HighOrderMesh& mesh, const Team& team, const Ranks& ranks) {
  const std::vector<std::int8_t> signs = centre_signs(mesh, team);
  if (2 * ranks.sum(std::ranges::count(signs, -1)) <= ranks.sum(std::ssize(signs))) return 1;
  // Cells that turn far, as parts of a spiral, may be inverted with straight sides although none is as it is curved.
  const Cells cells(mesh, mesh.dimension);
  const auto all = facets_of(cells, [](std::size_t) { return true; });
  // All facets of a cell enclose it, so any origin will do; one near the cells costs the fewest digits.
  const std::array<double, 3> origin = centre(bounding_box(mesh, team));
  return ranks.sum(exact_sum(facet_volumes(mesh, cells, all, origin, team))) > 0 ? 1 : -1;
}

std::vector<char> clockwise_cells(const HighOrderMesh& mesh, const Facets& facets, const Team& team) {
  const Cells cells(mesh, mesh.dimension);
  const std::vector<std::int8_t> sign = centre_signs(mesh, team);
  if (std::ranges::count(sign, 1) == std::ssize(sign) && all_agree(cells, facets, team)) return {};
  const JoinedCells joined = join_cells(cells, facets, sign);
  const auto outer = facets_of(cells, [&](std::size_t index) { return facets.neighbour[index] < 0; });
  const std::vector<double> parts = facet_volumes(mesh, cells, outer, centre(bounding_box(mesh, team)), team);
  std::vector<ExactSum> enclosed(joined.groups.size());
  for (std::size_t i = 0; i < outer.size(); ++i) {
    const auto cell = static_cast<std::size_t>(outer[i].cell);
    enclosed[static_cast<std::size_t>(joined.group[cell])].add(joined.sense[cell] * parts[i]);
  }
  std::vector<char> clockwise(cells.count());
  for (std::size_t cell = 0; cell < clockwise.size(); ++cell) {
    const auto group = static_cast<std::size_t>(joined.group[cell]);
    const bool is_turned = !joined.groups[group].is_upright && enclosed[group].value() < 0;
    clockwise[cell] = joined.groups[group].is_consistent && (joined.sense[cell] < 0) != is_turned ? 1 : 0;
  }
  if (std::ranges::count(clockwise, 1) == 0) return {};
  return clockwise;
}

void turn_cells(HighOrderMesh& mesh, std::span<const char> which, const Team& team) {
  std::size_t first = 0;
  for (ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != mesh.dimension || block.size() == 0) continue;
    const std::vector<int>& turned = reference::turned_nodes(block.shape, block.order);
    team.for_ranges(block.size(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
      std::vector<std::int32_t> before(turned.size());
      for (std::size_t e = begin; e < end; ++e) {
        if (which[first + e] == 0) continue;
        std::int32_t* nodes = block.nodes.data() + e * turned.size();
        std::copy_n(nodes, turned.size(), before.begin());
        for (std::size_t k = 0; k < turned.size(); ++k) nodes[k] = before[static_cast<std::size_t>(turned[k])];
      }
    });
    first += block.size();
  }
}

std::vector<std::int64_t> cell_numbers(const HighOrderMesh& mesh, std::span<const char> which) {
  std::vector<std::int64_t> numbers;
  const Cells cells(mesh, mesh.dimension);
  for (std::size_t cell = 0; cell < which.size(); ++cell)
    if (which[cell] != 0) numbers.push_back(cells.number(cell));
  return numbers;
}

OrientedMesh::OrientedMesh(const HighOrderMesh& mesh, const Team& team, const Facets* facets) : mesh_(mesh) {
  const std::vector<char> clockwise = facets != nullptr ? clockwise_cells(mesh, *facets, team)
                                                        : clockwise_cells(mesh, varimesh::facets(mesh, team), team);
  if (clockwise.empty()) return;
  clockwise_ = cell_numbers(mesh, clockwise);
  turned_ = mesh;
  turn_cells(*turned_, clockwise, team);
}

}  // namespace varimesh::detail
