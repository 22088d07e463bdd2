// Finds the cells that need a substitute, and makes one for each.
#include "core/problem/substitute_shapes.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "core/base/index.h"
#include "core/diagnosis/node_positions.h"
#include "core/mesh/connectivity.h"
#include "core/problem/node_conversion.h"
#include "core/problem/regular_shape.h"
#include "core/reference/basis.h"
#include "core/reference/quadrature.h"
#include "core/validity/orientation.h"

namespace varimesh {
namespace {

using Vertices = SubstituteShapes::Vertices;

// Both limits of flatness were chosen on a published lattice structure of 6,414 quadratic tetrahedra (docs/meshes.md).
// The best mesh came from these; larger ones cost mean quality. In meshes that were taken before there were
// substitutes, no cell is below them.
constexpr double kFlatCorner = 0.05;
constexpr double kFlatShare = 0.1;
/// From 0.01 to 0.3 the result on that structure is the same; at 1 its mean is lower.
constexpr double kLeastShare = 0.01;
constexpr std::size_t kCellsPerTask = 1024;

// ---------------------------------------------------------------------------------------------------------------------
// Flat cells
// ---------------------------------------------------------------------------------------------------------------------

/// A vertex with as many edges as there are dimensions, and the other ends of these edges. The apex of a pyramid has
/// four edges, so it is no corner.
struct Corner {
  std::size_t vertex;
  std::vector<std::size_t> others;
};

std::vector<Corner> corners(Shape shape) {
  const reference::ShapeInfo& info = reference::info(shape);
  std::vector<Corner> result;
  for (std::size_t v = 0; v < at(info.vertices); ++v) {
    Corner corner{v, {}};
    for (const auto& edge : info.edges) {
      if (at(edge[0]) == v) corner.others.push_back(at(edge[1]));
      if (at(edge[1]) == v) corner.others.push_back(at(edge[0]));
    }
    if (corner.others.size() == at(info.dimension)) result.push_back(corner);
  }
  return result;
}

/// Whether the unit vectors along the edges have a determinant of more than kFlatCorner at some corner.
bool has_thick_corner(const std::vector<Corner>& corners, int dimension, const std::vector<double>& coordinates,
                      const std::int32_t* nodes) {
  const auto position = [&](std::size_t v) {
    return Eigen::Map<const Eigen::Vector3d>(&coordinates[3 * at(nodes[v])]);
  };
  return std::ranges::any_of(corners, [&](const Corner& corner) {
    Eigen::Matrix3d edges = Eigen::Matrix3d::Identity();
    for (std::size_t k = 0; k < corner.others.size(); ++k)
      edges.col(static_cast<Eigen::Index>(k)).head(dimension) =
          (position(corner.others[k]) - position(corner.vertex)).head(dimension);
    const double determinant = edges.determinant();
    const double lengths = edges.colwise().squaredNorm().prod();
    return determinant * determinant > kFlatCorner * kFlatCorner * lengths;
  });
}

// ---------------------------------------------------------------------------------------------------------------------
// What a cell encloses
// ---------------------------------------------------------------------------------------------------------------------

struct Enclosed {
  double volume = 0;                                   // ∫ det ∇χ, relative to the mesh's orientation
  Eigen::Matrix3d gradient = Eigen::Matrix3d::Zero();  // ∫ ∇χ; in 2-D (2, 2) is 1
};

class Integrator {
 public:
  explicit Integrator(const HighOrderMesh& mesh)
      : mesh_(mesh), cells_(mesh, mesh.dimension), sign_(detail::orientation(mesh)) {
    for (const Cells::Range& range : cells_.ranges()) {
      const ElementBlock& block = *range.block;
      if (tables_.contains(block.shape)) continue;
      // Exact for J on every shape but the pyramid, where J is not a polynomial.
      const int degree = mesh.dimension * block.order - (reference::info(block.shape).affine ? mesh.dimension : 1);
      const reference::Quadrature rule = reference::quadrature(block.shape, block.order, std::max(1, degree));
      const auto gradients = [&](int order) {
        return reference::basis_gradients(block.shape, order, reference::NodeSet::Equispaced, mesh.dimension,
                                          rule.points);
      };
      tables_[block.shape] = {rule.weights, gradients(block.order), gradients(1)};
    }
  }

  const Cells& cells() const { return cells_; }
  double sign() const { return sign_; }

  Enclosed curved(std::size_t cell) const {
    const Tables& tables = tables_.at(cells_.shape(cell));
    return integrate(detail::node_positions(mesh_.coordinates, cells_.nodes(cell)), tables.weights, tables.curved);
  }
  /// Of a straight-sided cell with these vertices, one per row.
  Enclosed straight(Shape shape, const Eigen::MatrixXd& vertices) const {
    const Tables& tables = tables_.at(shape);
    return integrate(vertices, tables.weights, tables.straight);
  }
  Eigen::MatrixXd vertices(std::size_t cell) const {
    return detail::node_positions(mesh_.coordinates,
                                  cells_.nodes(cell).first(at(reference::info(cells_.shape(cell)).vertices)));
  }

 private:
  struct Tables {
    Eigen::VectorXd weights;
    std::vector<Eigen::MatrixXd> curved;    // by direction: points × nodes
    std::vector<Eigen::MatrixXd> straight;  // by direction: points × vertices
  };

  Enclosed integrate(Eigen::MatrixXd x, const Eigen::VectorXd& weights,
                     const std::vector<Eigen::MatrixXd>& basis) const {
    x.rowwise() -= Eigen::RowVector3d(x.row(0));
    Enclosed result;
    const int d = mesh_.dimension;
    for (Eigen::Index q = 0; q < weights.size(); ++q) {
      Eigen::Matrix3d gradient = Eigen::Matrix3d::Identity();
      for (int k = 0; k < d; ++k) gradient.col(k).head(d) = x.leftCols(d).transpose() * basis[at(k)].row(q).transpose();
      result.volume += sign_ * weights[q] * gradient.determinant();
      result.gradient += weights[q] * gradient;
    }
    return result;
  }

  const HighOrderMesh& mesh_;
  Cells cells_;
  double sign_;
  std::map<Shape, Tables> tables_;
};

enum Need : char { kNone, kNearlyFlat, kInverted };

/// By cell: what its vertices say. For nearly all meshes they say that no cell needs a substitute, and then no table is
/// made.
std::vector<Need> needs_by_vertices(const HighOrderMesh& mesh, const Cells& cells, const std::vector<char>& sound,
                                    const Team& team) {
  std::vector<Need> needs(sound.size(), kNone);
  for (const Cells::Range& range : cells.ranges()) {
    const std::vector<Corner> at_corners = corners(range.block->shape);
    team.for_ranges(range.block->size(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t e = begin; e < end; ++e) {
        const std::size_t cell = range.first + e;
        const std::int32_t* nodes = range.block->nodes.data() + e * range.stride;
        if (sound[cell] == 0)
          needs[cell] = kInverted;
        else if (!has_thick_corner(at_corners, mesh.dimension, mesh.coordinates, nodes))
          needs[cell] = kNearlyFlat;
      }
    });
  }
  return needs;
}

/// Whether a nearly flat cell encloses so much more with curved sides that it needs a substitute.
bool is_flat_for_its_volume(const Integrator& integrator, std::size_t cell) {
  return integrator.straight(integrator.cells().shape(cell), integrator.vertices(cell)).volume <
         kFlatShare * integrator.curved(cell).volume;
}

/// The volume of a cell's substitute.
double volume_for(const HighOrderMesh& mesh, const Integrator& integrator, const Facets& facet, std::size_t cell) {
  const double own = integrator.curved(cell).volume;
  double sum = 0;
  int count = 0;
  const auto add = [&](std::size_t other) {
    const double volume = integrator.curved(other).volume;
    sum += std::max(volume, 0.0);
    count += volume > 0 ? 1 : 0;
  };
  for (std::int32_t f = facet.first[cell]; f < facet.first[cell + 1]; ++f)
    if (facet.neighbour[at(f)] >= 0) add(at(facet.neighbour[at(f)]));
  if (count > 0) return own > kLeastShare * sum / count ? own : sum / count;
  if (own > 0) return own;
  for (std::size_t other = 0; other < integrator.cells().count(); ++other) add(other);
  // A mesh that encloses nothing: any size will do.
  return count > 0
             ? sum / count
             : std::pow(frame_of(mesh).diagonal, mesh.dimension) / static_cast<double>(integrator.cells().count());
}

// ---------------------------------------------------------------------------------------------------------------------
// Shapes
// ---------------------------------------------------------------------------------------------------------------------

/// The vertices of the regular shape with this volume, turned to the curved cell.
Eigen::MatrixXd regular(const Integrator& integrator, std::size_t cell, int d, double volume) {
  const Shape shape = integrator.cells().shape(cell);
  const reference::ShapeInfo& info = reference::info(shape);
  const Eigen::MatrixXd W = regular_shape(shape).topLeftCorner(d, d);
  const Eigen::MatrixXd gradient = integrator.curved(cell).gradient.topLeftCorner(d, d) * W.inverse();
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(gradient, Eigen::ComputeFullU | Eigen::ComputeFullV);
  // The closest rotation, or in a clockwise mesh the closest reflection: the smallest singular value changes its sign.
  Eigen::VectorXd signs = Eigen::VectorXd::Ones(d);
  if (svd.matrixU().determinant() * svd.matrixV().determinant() * integrator.sign() < 0) signs[d - 1] = -1;
  const Eigen::MatrixXd A = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose() * W;
  Eigen::MatrixXd x = Eigen::MatrixXd::Zero(info.vertices, 3);
  for (int v = 0; v < info.vertices; ++v)
    for (int k = 0; k < d; ++k) x.row(v).head(d) += info.vertex[at(v)][at(k)] * A.col(k).transpose();
  return x * std::pow(volume / integrator.straight(shape, x).volume, 1.0 / d);
}

Vertices as_vertices(const Eigen::MatrixXd& x) {
  Vertices vertices{};
  for (Eigen::Index v = 0; v < x.rows(); ++v)
    for (int c = 0; c < 3; ++c) vertices[at(v)][at(c)] = x(v, c);
  return vertices;
}

}  // namespace

const Vertices* SubstituteShapes::of(std::int32_t cell) const {
  const auto found = std::ranges::lower_bound(cells, cell);
  return found != cells.end() && *found == cell ? &vertices[at(found - cells.begin())] : nullptr;
}

SubstituteShapes substitute_shapes(const HighOrderMesh& mesh, const Facets& facets, const std::vector<char>& sound,
                                   const Team& team) {
  SubstituteShapes result;
  const std::vector<Need> needs = needs_by_vertices(mesh, Cells(mesh, mesh.dimension), sound, team);
  if (std::ranges::all_of(needs, [](Need need) { return need == kNone; })) return result;
  const Integrator integrator(mesh);
  for (std::size_t cell = 0; cell < needs.size(); ++cell)
    if (needs[cell] == kInverted || (needs[cell] == kNearlyFlat && is_flat_for_its_volume(integrator, cell)))
      result.cells.push_back(static_cast<std::int32_t>(cell));
  if (result.cells.empty()) return result;
  for (const std::int32_t c : result.cells) {
    const auto cell = at(c);
    result.vertices.push_back(
        as_vertices(regular(integrator, cell, mesh.dimension, volume_for(mesh, integrator, facets, cell))));
  }
  return result;
}

}  // namespace varimesh
