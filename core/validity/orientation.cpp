// The sign that most straight-sided cells have.
#include "core/validity/orientation.h"

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>

#include "core/mesh/connectivity.h"
#include "core/reference/basis.h"
#include "core/validity/cell_batches.h"

namespace varimesh::detail {
namespace {

constexpr std::size_t kCellsPerTask = 4096;

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

/// det ∇χ_L at the centre of the straight-sided cell with these vertices.
double centre_jacobian(const HighOrderMesh& mesh, const std::int32_t* nodes, const Eigen::MatrixXd& gradients) {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  const int d = mesh.dimension;
  matrix.topLeftCorner(d, d).setZero();
  for (Eigen::Index v = 0; v < gradients.rows(); ++v)
    for (int c = 0; c < d; ++c) {
      const double x = mesh.coordinates[3 * static_cast<std::size_t>(nodes[v]) + static_cast<std::size_t>(c)] -
                       mesh.coordinates[3 * static_cast<std::size_t>(nodes[0]) + static_cast<std::size_t>(c)];
      for (int r = 0; r < d; ++r) matrix(c, r) += x * gradients(v, r);
    }
  return matrix(0, 0) * (matrix(1, 1) * matrix(2, 2) - matrix(1, 2) * matrix(2, 1)) -
         matrix(0, 1) * (matrix(1, 0) * matrix(2, 2) - matrix(1, 2) * matrix(2, 0)) +
         matrix(0, 2) * (matrix(1, 0) * matrix(2, 1) - matrix(1, 1) * matrix(2, 0));
}

/// By cell: −1 if det ∇χ_L is negative at its centre, else 1.
std::vector<std::int8_t> centre_signs(const HighOrderMesh& mesh, const Team& team) {
  const auto gradients = tables_for_cells<Eigen::MatrixXd>(
      mesh, [&](Shape shape, int) { return centre_gradients(shape, mesh.dimension); });
  const std::vector<CellBatch> batches = cell_batches(mesh, [](const ElementBlock&) { return kCellsPerTask; });
  std::vector<std::int8_t> signs(mesh.element_count(mesh.dimension));
  team.for_each(static_cast<std::int32_t>(batches.size()), 1, [&](std::int32_t b) {
    const CellBatch& batch = batches[static_cast<std::size_t>(b)];
    const Eigen::MatrixXd& gradient = gradients.at({batch.block->shape, batch.block->order});
    for (std::size_t i = 0; i < batch.count; ++i)
      signs[batch.cell + i] = centre_jacobian(mesh, batch.nodes(i), gradient) < 0 ? -1 : 1;
  });
  return signs;
}

/// Whether two cells with a common facet are numbered in the same sense. Each lists the facet's vertices
/// counter-clockwise as seen from outside, so the other then lists them in reverse.
bool agree(const Cells& cells, std::size_t a, std::size_t facet_of_a, std::size_t b, std::size_t facet_of_b) {
  const auto vertices = [&](std::size_t cell, std::size_t facet) {
    std::vector<std::int32_t> list;
    for (const std::int8_t v : reference::info(cells.shape(cell)).facets[facet].vertices)
      if (v >= 0) list.push_back(cells.nodes(cell)[static_cast<std::size_t>(v)]);
    return list;
  };
  const std::vector<std::int32_t> first = vertices(a, facet_of_a), second = vertices(b, facet_of_b);
  const auto same = static_cast<std::size_t>(std::ranges::find(second, first.front()) - second.begin());
  // Two vertices have no order round the facet, but a direction along it.
  return first.size() == 2 ? same == 1 : second[(same + 1) % second.size()] == first.back();
}

/// The cells that are joined with this one across facets. Sets their senses relative to it, 1 or −1.
std::vector<std::int32_t> joined_cells(const Cells& cells, const Facets& facet, std::int32_t start,
                                       std::vector<std::int8_t>& sense) {
  std::vector<std::int32_t> group{start};
  sense[static_cast<std::size_t>(start)] = 1;
  for (std::size_t next = 0; next < group.size(); ++next) {
    const auto cell = static_cast<std::size_t>(group[next]);
    for (std::int32_t f = facet.first[cell]; f < facet.first[cell + 1]; ++f) {
      const std::int32_t other = facet.neighbour[static_cast<std::size_t>(f)];
      if (other < 0 || sense[static_cast<std::size_t>(other)] != 0) continue;
      const std::int32_t opposite = facet.opposite[static_cast<std::size_t>(f)];
      const bool same =
          agree(cells, cell, static_cast<std::size_t>(f - facet.first[cell]), static_cast<std::size_t>(other),
                static_cast<std::size_t>(opposite - facet.first[static_cast<std::size_t>(other)]));
      sense[static_cast<std::size_t>(other)] = static_cast<std::int8_t>(same ? sense[cell] : -sense[cell]);
      group.push_back(other);
    }
  }
  return group;
}

}  // namespace

double orientation(const HighOrderMesh& mesh, const Team& team) {
  const std::vector<std::int8_t> signs = centre_signs(mesh, team);
  return 2 * std::ranges::count(signs, -1) > std::ssize(signs) ? -1 : 1;
}

std::vector<char> numbered_against_most(const HighOrderMesh& mesh, const Facets& facet, const Team& team) {
  const std::vector<std::int8_t> sign = centre_signs(mesh, team);
  if (sign.empty() || std::ranges::count(sign, sign.front()) == std::ssize(sign)) return {};
  const Cells cells(mesh, mesh.dimension);
  std::vector<std::int8_t> sense(cells.count(), 0);
  std::int64_t sum = 0;
  std::vector<std::int32_t> isolated;  // cells without a neighbour
  for (std::size_t start = 0; start < sense.size(); ++start) {
    if (sense[start] != 0) continue;
    const auto group = joined_cells(cells, facet, static_cast<std::int32_t>(start), sense);
    std::int64_t agreeing = 0;
    for (const std::int32_t cell : group)
      agreeing += sense[static_cast<std::size_t>(cell)] * sign[static_cast<std::size_t>(cell)];
    for (const std::int32_t cell : group)
      if (agreeing < 0) sense[static_cast<std::size_t>(cell)] *= -1;
    if (group.size() == 1) isolated.push_back(group.front());
    for (const std::int32_t cell : group) sum += sense[static_cast<std::size_t>(cell)];
  }
  const std::int8_t most = sum < 0 ? -1 : 1;
  for (const std::int32_t cell : isolated) sense[static_cast<std::size_t>(cell)] = most;
  std::vector<char> against(sense.size(), 0);
  for (std::size_t cell = 0; cell < sense.size(); ++cell) against[cell] = sense[cell] != most ? 1 : 0;
  if (std::ranges::count(against, 1) == 0) return {};
  return against;
}

}  // namespace varimesh::detail
