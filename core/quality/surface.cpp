// Mean normals of the cells of a surface, and the cells in the planes perpendicular to them.
#include "core/quality/surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/mesh/check.h"
#include "core/mesh/connectivity.h"
#include "core/reference/basis.h"
#include "core/reference/quadrature.h"
#include "core/validity/cell_batches.h"

namespace varimesh::detail {
namespace {

constexpr std::size_t kCellsPerTask = 256;

/// What the mean normal of a cell of one shape and order is made with.
struct NormalTable {
  Eigen::VectorXd weights;
  Eigen::MatrixXd along[2];  ///< Gradients of the basis in both directions: points × nodes.
};

NormalTable make_table(Shape shape, int order) {
  // x_ξ × x_η has the degree 2 P − 2 on triangles, and 2 P − 1 in each direction on quadrilaterals.
  const reference::Quadrature rule = reference::quadrature(shape, order, 2 * order - 1);
  const auto gradients = reference::basis_gradients(shape, order, reference::NodeSet::Equispaced, 2, rule.points);
  return {rule.weights, {gradients[0], gradients[1]}};
}

Eigen::Map<const Eigen::RowVector3d> position(const HighOrderMesh& mesh, std::int32_t node) {
  return Eigen::Map<const Eigen::RowVector3d>(mesh.coordinates.data() + 3 * static_cast<std::size_t>(node));
}

/// ∫ x_ξ × x_η over the reference cell.
Eigen::Vector3d normal_of(const HighOrderMesh& mesh, std::span<const std::int32_t> nodes, const NormalTable& table) {
  Eigen::MatrixX3d x(static_cast<Eigen::Index>(nodes.size()), 3);
  for (std::size_t n = 0; n < nodes.size(); ++n)
    x.row(static_cast<Eigen::Index>(n)) = position(mesh, nodes[n]) - position(mesh, nodes[0]);
  const Eigen::MatrixX3d u = table.along[0] * x, v = table.along[1] * x;
  Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
  for (Eigen::Index q = 0; q < u.rows(); ++q)
    sum += table.weights[q] * Eigen::RowVector3d(u.row(q)).cross(Eigen::RowVector3d(v.row(q)));
  return sum.transpose();
}

/// ∫ x_ξ × x_η of all cells.
std::vector<Eigen::Vector3d> normals(const HighOrderMesh& mesh, const Cells& cells, const Team& team) {
  const auto tables = tables_for_cells<NormalTable>(mesh, make_table);
  std::vector<Eigen::Vector3d> result(cells.count());
  team.for_ranges(cells.count(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t cell = begin; cell < end; ++cell)
      result[cell] = normal_of(mesh, cells.nodes(cell), tables.at({cells.shape(cell), mesh.order}));
  });
  return result;
}

/// Rows e₁, e₂, n with n along the normal. If the normal is zero, the cell is invalid in any plane.
Eigen::Matrix3d axes_of(const Eigen::Vector3d& normal) {
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  if (!(normal.stableNorm() > 0)) return axes;
  const Eigen::Vector3d n = normal.stableNormalized(), first = n.unitOrthogonal();
  axes << first.transpose(), n.cross(first).transpose(), n.transpose();
  return axes;
}

}  // namespace

FlatSurface::FlatSurface(const HighOrderMesh& surface, const Team& team) {
  const Cells cells(surface, surface.dimension);
  for (std::size_t cell = 0; cell < cells.count(); ++cell) numbers_.push_back(cells.number(cell));
  const std::vector<Eigen::Vector3d> normal = normals(surface, cells, team);
  const auto frame_of = [&](std::size_t cell) {
    return Frame{position(surface, cells.nodes(cell)[0]).transpose(), axes_of(normal[cell])};
  };
  const auto largest = std::ranges::max_element(normal, {}, [](const Eigen::Vector3d& n) { return n.squaredNorm(); });
  const Frame common = frame_of(static_cast<std::size_t>(largest - normal.begin()));
  put_in_one_plane(surface, common, team);
  if (lies_flat(mesh_, team)) {
    frames_ = {common};
  } else {
    for (std::size_t cell = 0; cell < cells.count(); ++cell) frames_.push_back(frame_of(cell));
    put_in_own_planes(surface, team);
  }
  std::int64_t number = 0;
  for (ElementBlock& block : mesh_.blocks)
    if (reference::info(block.shape).dimension == mesh_.dimension)
      for (std::int64_t& of_element : block.numbers) of_element = number++;
}

void FlatSurface::put_in_one_plane(const HighOrderMesh& surface, const Frame& frame, const Team& team) {
  mesh_ = surface;
  team.for_ranges(mesh_.node_count(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t node = begin; node < end; ++node) {
      Eigen::Map<Eigen::Vector3d> x(mesh_.coordinates.data() + 3 * node);
      x = (frame.axes * (x - frame.origin)).eval();
    }
  });
}

void FlatSurface::put_in_own_planes(const HighOrderMesh& surface, const Team& team) {
  mesh_ = {};
  mesh_.dimension = surface.dimension;
  mesh_.order = surface.order;
  std::int32_t node = 0;
  for (const ElementBlock& block : surface.blocks) {
    if (reference::info(block.shape).dimension != surface.dimension || block.size() == 0) continue;
    ElementBlock& own = mesh_.blocks.emplace_back();
    own.shape = block.shape;
    own.order = block.order;
    own.numbers = block.numbers;
    own.nodes.resize(block.nodes.size());
    for (std::int32_t& of_cell : own.nodes) of_cell = node++;
  }
  mesh_.coordinates.resize(3 * static_cast<std::size_t>(node));
  for (std::int64_t number = 1; number <= node; ++number) mesh_.node_numbers.push_back(number);
  const Cells from(surface, surface.dimension), to(mesh_, mesh_.dimension);
  team.for_ranges(from.count(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t cell = begin; cell < end; ++cell) {
      const Frame& frame = frames_[cell];
      for (std::size_t n = 0; n < from.nodes(cell).size(); ++n)
        Eigen::Map<Eigen::Vector3d>(mesh_.coordinates.data() + 3 * static_cast<std::size_t>(to.nodes(cell)[n])) =
            frame.axes * (position(surface, from.nodes(cell)[n]).transpose() - frame.origin);
    }
  });
}

void FlatSurface::put_in_space(QualityReport& report) const {
  const auto put = [&](auto& element) {
    const auto cell = static_cast<std::size_t>(element.number);
    const Frame& frame = frames_[is_plane() ? 0 : cell];
    const Eigen::Vector3d place = Eigen::Map<const Eigen::Vector3d>(element.place.data());
    Eigen::Map<Eigen::Vector3d>(element.place.data()) = frame.axes.transpose() * place + frame.origin;
    element.number = numbers_[cell];
  };
  std::ranges::for_each(report.invalid, put);
  std::ranges::for_each(report.uncertified, put);
  report.is_surface = true;
  if (!is_plane()) report.accuracy.reset();  // the planar cells do not show how far the surface bends
}

JudgedMesh::JudgedMesh(const HighOrderMesh& mesh, const Team& team, const Facets* facets) {
  if (is_surface(mesh, team)) surface_.emplace(mesh, team);
  oriented_.emplace(surface_ ? surface_->mesh() : mesh, team, surface_ ? nullptr : facets);
}

std::vector<std::int64_t> JudgedMesh::clockwise() const {
  return surface_ ? std::vector<std::int64_t>() : oriented_->clockwise();
}

}  // namespace varimesh::detail
