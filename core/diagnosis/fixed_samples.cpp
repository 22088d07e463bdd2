// Samples J and normals of the few cells and facets whose nodes are fixed.
#include "core/diagnosis/fixed_samples.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>

#include "core/base/index.h"
#include "core/diagnosis/node_positions.h"
#include "core/diagnosis/vector.h"
#include "core/reference/cache.h"

namespace varimesh::detail {
namespace {

/// J and normals below this fraction of the largest count as zero. It is well above the rounding of a high-order
/// gradient.
constexpr double kZero = 1e-10;
/// A facet is flat if no node is further from its plane than this fraction of its size.
constexpr double kFlat = 1e-6;
/// A curved facet with less room counts as folded. On six meshes of CAD parts, facets whose normals turn by more than
/// 90° have either at most .23 or at least .37, mostly above .6. The limit was chosen on these meshes.
constexpr double kLeastRoom = 0.3;

Vector row(const Eigen::MatrixXd& matrix, Eigen::Index i) { return {matrix(i, 0), matrix(i, 1), matrix(i, 2)}; }

/// Whether a point of the reference cell lies on the plane of a facet (in 2-D on its line).
bool on_facet(const reference::ShapeInfo& shape, const reference::Facet& facet, const Vector& p) {
  const auto corner = [&](std::size_t k) { return shape.vertex[at(facet.vertices[k])]; };
  const auto from_first = [&](const Vector& x) { return minus(x, corner(0)); };
  const Vector last = shape.dimension == 2 ? Vector{0, 0, 1} : from_first(corner(2));
  return std::abs(determinant(from_first(corner(1)), last, from_first(p))) < 1e-9;
}

/// Rows of more bytes than this are not kept. Those of a hexahedron of order 6 and of a tetrahedron of order 10 take
/// less. Only the few cells between fixed facets are sampled, so making rows again for each of them costs little.
constexpr std::size_t kMostKept = std::size_t{80} << 20;
constexpr std::size_t kRangeBytes = std::size_t{4} << 20;
/// Points whose rows are made between two looks at the stop token.
constexpr Eigen::Index kPointsBetweenLooks = 256;

int lattice_intervals(int order) { return std::max(2 * order + 2, 8); }

}  // namespace

// ---------------------------------------------------------------------------------------------------------------------
// The point condition
// ---------------------------------------------------------------------------------------------------------------------

FixedSamples::Rows FixedSamples::Table::make_rows(Eigen::Index first, Eigen::Index count) const {
  Rows rows{first, count, basis.gradients(first, count), {}};
  for (Eigen::Index p = 0; p < count; ++p) {
    std::vector<int>& enter = rows.enter.emplace_back();
    for (Eigen::Index n = 0; n < rows.gradients[0].cols(); ++n) {
      double most = 0;
      for (const Eigen::MatrixXd& gradient : rows.gradients) most = std::max(most, std::abs(gradient(p, n)));
      if (most > 1e-9) enter.push_back(static_cast<int>(n));
    }
  }
  return rows;
}

void FixedSamples::Table::keep_all(const StopToken* stop) {
  const Eigen::Index all = basis.points().rows();
  for (Eigen::Index first = 0; first < all; first += kPointsBetweenLooks) {
    look(stop);
    const Eigen::Index count = std::min(kPointsBetweenLooks, all - first);
    Rows rows = make_rows(first, count);
    const Eigen::MatrixXd here = basis.values(first, count);
    if (first == 0) {
      kept.gradients.assign(rows.gradients.size(), Eigen::MatrixXd(all, here.cols()));
      values.resize(all, here.cols());
    }
    for (std::size_t r = 0; r < rows.gradients.size(); ++r)
      kept.gradients[r].middleRows(first, count) = rows.gradients[r];
    values.middleRows(first, count) = here;
    std::ranges::move(rows.enter, std::back_inserter(kept.enter));
  }
  kept.count = all;
}

FixedSamples::Table FixedSamples::make_table(Shape shape, int order, int dimension, const StopToken* stop) {
  const reference::ShapeInfo& info = reference::info(shape);
  reference::Points points = reference::uniform_lattice(shape, lattice_intervals(order));
  if (shape == Shape::Pyramid) {
    // Near the apex the basis, which is rational, loses digits: leave those points out.
    std::vector<Eigen::Index> keep;
    for (Eigen::Index p = 0; p < points.rows(); ++p)
      if (points(p, 2) < 0.99) keep.push_back(p);
    points = reference::Points(points(keep, Eigen::all));
  }
  Table table({shape, order, reference::NodeSet::Equispaced, dimension, points});
  for (std::size_t f = 0; f < info.facets.size(); ++f)
    table.facets.push_back(reference::facet_nodes(shape, order, static_cast<int>(f)));
  for (Eigen::Index p = 0; p < points.rows(); ++p) {
    Vector point{};
    for (int c = 0; c < dimension; ++c) point[at(c)] = points(p, c);
    const auto on = std::ranges::count_if(info.facets, [&](const auto& facet) { return on_facet(info, facet, point); });
    table.dimension.push_back(std::max(0, dimension - static_cast<int>(on)));
    table.vertex.push_back(-1);
    for (int v = 0; v < info.vertices; ++v) {
      const Vector& corner = info.vertex[at(v)];
      if (std::abs(corner[0] - point[0]) + std::abs(corner[1] - point[1]) + std::abs(corner[2] - point[2]) < 1e-9)
        table.vertex.back() = v;
    }
  }
  const std::size_t row_bytes =
      at(reference::node_count(shape, order)) * (sizeof(double) * at(dimension + 1) + sizeof(int));
  const bool is_small = row_bytes * at(points.rows()) <= kMostKept;
  table.per_range = is_small ? points.rows() : static_cast<Eigen::Index>(kRangeBytes / row_bytes);
  if (!is_small) return table;
  table.keep_all(stop);
  return table;
}

const FixedSamples::Table& FixedSamples::table(Shape shape, int order, int dimension, const StopToken* stop) {
  static reference::Cache<std::array<int, 3>, Table> cache;
  return cache.get({static_cast<int>(shape), order, dimension},
                   [&] { return make_table(shape, order, dimension, stop); });
}

FixedSamples::FixedSamples(const HighOrderMesh& mesh, const Cells& cells) : mesh_(mesh), cells_(cells) {}

FixedSamples::Sampled FixedSamples::sample(const Table& table, const Eigen::MatrixXd& x, const std::vector<bool>& held,
                                           double sign, const StopToken* stop) {
  Sampled out;
  const Eigen::Index points = table.basis.points().rows();
  for (Eigen::Index first = 0; first < points; first += table.per_range) {
    look(stop);
    const Rows made = table.kept.count > 0 ? Rows() : table.make_rows(first, std::min(table.per_range, points - first));
    const Rows& rows = table.kept.count > 0 ? table.kept : made;
    std::array<Eigen::MatrixXd, 3> g;
    for (std::size_t r = 0; r < rows.gradients.size(); ++r) g[r] = rows.gradients[r] * x;
    for (Eigen::Index p = 0; p < rows.count; ++p) {
      out.jacobian.push_back(sign * (rows.gradients.size() == 2
                                         ? g[0](p, 0) * g[1](p, 1) - g[0](p, 1) * g[1](p, 0)
                                         : determinant(row(g[0], p), row(g[1], p), row(g[2], p))));
      out.is_held.push_back(std::ranges::all_of(rows.enter[at(p)], [&](int n) { return held[at(n)]; }) ? 1 : 0);
    }
  }
  return out;
}

std::vector<FixedSample> FixedSamples::worst(std::size_t cell, const std::vector<bool>& fixed, double sign,
                                             const StopToken* stop) const {
  const auto nodes = cells_.nodes(cell);
  const Table& table = FixedSamples::table(cells_.shape(cell), mesh_.order, mesh_.dimension, stop);
  std::vector<bool> held;
  for (const std::int32_t node : nodes) held.push_back(fixed[at(node)]);
  const auto is_fixed = [&](const auto& facet) {
    return std::ranges::all_of(facet, [&](int n) { return held[at(n)]; });
  };
  // Such a point can only lie between two fixed facets (except at vertices in 3-D).
  if (std::ranges::count_if(table.facets, is_fixed) < 2) return {};
  const Eigen::MatrixXd x = node_positions(mesh_.coordinates, nodes);
  const Sampled sampled = sample(table, x, held, sign, stop);
  double largest = 0;
  for (const double jacobian : sampled.jacobian) largest = std::max(largest, std::abs(jacobian));
  std::array<std::optional<FixedSample>, 4> worst;
  for (std::size_t p = 0; p < sampled.jacobian.size(); ++p) {
    const int dimension = table.dimension[p];
    if ((mesh_.dimension == 3 && dimension == 0) || sampled.is_held[p] == 0) continue;
    const double relative = largest > 0 ? sampled.jacobian[p] / largest : 0;
    auto& entry = worst[at(dimension)];
    if (relative > kZero || (entry && entry->jacobian <= relative)) continue;
    const auto point = static_cast<Eigen::Index>(p);
    const Vector place =
        table.values.size() > 0 ? row(table.values.row(point) * x, 0) : row(table.basis.values(point, 1).row(0) * x, 0);
    entry = FixedSample{dimension, table.vertex[p], place, relative};
  }
  std::vector<FixedSample> result;
  for (const auto& entry : worst)
    if (entry) result.push_back(*entry);
  return result;
}

// ---------------------------------------------------------------------------------------------------------------------
// Folded facets
// ---------------------------------------------------------------------------------------------------------------------

FoldedFacets::FoldedFacets(const HighOrderMesh& mesh, const Cells& cells) : mesh_(mesh), cells_(cells) {
  constexpr auto kNodes = reference::NodeSet::Equispaced;
  for (const Cells::Range& range : cells.ranges())
    for (const reference::Facet& facet : reference::info(range.block->shape).facets) {
      if (tables_.contains(facet.shape)) continue;
      const reference::Points points = reference::uniform_lattice(facet.shape, lattice_intervals(mesh.order));
      tables_[facet.shape] = {
          reference::basis_values(facet.shape, mesh.order, kNodes, mesh.dimension, points),
          reference::basis_gradients(facet.shape, mesh.order, kNodes, mesh.dimension, points),
          facet.shape == Shape::Triangle ? bernstein_on_triangle(mesh.order - 1, points) : Eigen::MatrixXd()};
    }
}

bool FoldedFacets::folded(const Table& table, const Eigen::MatrixXd& coordinates, FixedSample& sample) const {
  const Eigen::MatrixXd first = table.gradients[0] * coordinates;
  const bool line = table.gradients.size() == 1;
  const Eigen::MatrixXd second = line ? Eigen::MatrixXd() : Eigen::MatrixXd(table.gradients[1] * coordinates);
  // The normal, or the tangent of a line.
  std::vector<Vector> normal;
  std::size_t longest = 0;
  for (Eigen::Index p = 0; p < first.rows(); ++p) {
    normal.push_back(line ? row(first, p) : cross(row(first, p), row(second, p)));
    if (dot(normal.back(), normal.back()) > dot(normal[longest], normal[longest])) longest = at(p);
  }
  const double most = std::sqrt(dot(normal[longest], normal[longest]));
  if (!(most > 0)) return false;
  double least = std::numeric_limits<double>::max();
  Eigen::Index place = 0;
  for (std::size_t p = 0; p < normal.size(); ++p) {
    const double along = dot(normal[p], normal[longest]) / (most * most);
    if (along >= least) continue;
    least = along;
    place = static_cast<Eigen::Index>(p);
  }
  if (least > kZero) return false;
  // The normal of a flat facet must pass through zero to change sign. A curved one may turn, if it leaves room.
  double size = 0, off = 0;
  for (Eigen::Index n = 0; n < coordinates.rows(); ++n) {
    const Vector x = row(coordinates.row(n) - coordinates.row(0), 0);
    size = std::max(size, std::sqrt(dot(x, x)));
    const double along = dot(x, normal[longest]) / most;
    off = std::max(off, line ? std::sqrt(std::max(0.0, dot(x, x) - along * along)) : std::abs(along));
  }
  sample.jacobian = least;
  if (off > kFlat * size) {
    if (table.fields.size() == 0) return false;
    Eigen::MatrixXd unit(first.rows(), 3);
    for (Eigen::Index p = 0; p < unit.rows(); ++p) {
      const double length = std::sqrt(dot(normal[at(p)], normal[at(p)]));
      for (int c = 0; c < 3; ++c) unit(p, c) = length > 0 ? normal[at(p)][at(c)] / length : 0;
    }
    sample.is_curved = true;
    sample.jacobian = face_room(table.fields, unit, kLeastRoom);
    if (sample.jacobian > kLeastRoom) return false;
  }
  sample.place = row(table.values.row(place) * coordinates, 0);
  return true;
}

std::vector<FixedSample> FoldedFacets::in(std::size_t cell, const std::vector<bool>& fixed) const {
  std::vector<FixedSample> result;
  const auto nodes = cells_.nodes(cell);
  const Shape shape = cells_.shape(cell);
  const auto facets = reference::info(shape).facets;
  for (std::size_t f = 0; f < facets.size(); ++f) {
    const std::vector<int>& local = reference::facet_nodes(shape, mesh_.order, static_cast<int>(f));
    if (!std::ranges::all_of(local, [&](int n) { return fixed[at(nodes[at(n)])]; })) continue;
    std::vector<std::int32_t> facet_nodes;
    for (const int n : local) facet_nodes.push_back(nodes[at(n)]);
    FixedSample sample;
    sample.dimension = mesh_.dimension - 1;
    if (folded(tables_.at(facets[f].shape), node_positions(mesh_.coordinates, facet_nodes), sample))
      result.push_back(sample);
  }
  return result;
}

}  // namespace varimesh::detail
