#include "core/formats/nektar/place.h"

#include <algorithm>

#include "core/base/io/scanner.h"
#include "core/formats/mfem/space.h"
#include "core/formats/numbering/node_order.h"
#include "core/reference/basis.h"
#include "core/reference/nodes.h"

namespace varimesh::formats {

namespace {

using Columns = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

Eigen::Map<Eigen::RowVector3d> at(HighOrderMesh& mesh, std::int32_t node) {
  return Eigen::Map<Eigen::RowVector3d>(mesh.coordinates.data() + 3 * std::ptrdiff_t(node));
}

}  // namespace

int nektar_degree(Shape shape, std::int64_t points) {
  for (int degree = 1; degree <= kMaxOrder; ++degree)
    if (points == reference::node_count(shape, degree)) return degree;
  return 0;
}

void place_straight_edges(Shape shape, std::span<const std::int32_t> nodes, const std::vector<bool>& placed,
                          HighOrderMesh& mesh) {
  const MfemLocalNodes& local = mfem_local_nodes(shape, mesh.order);
  const auto edges = edges_of(Sides::Mfem, shape);
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const std::vector<int>& inner = local.edges[e];
    if (inner.empty() || placed[std::size_t(nodes[std::size_t(inner.front())])]) continue;
    std::int32_t a = nodes[std::size_t(edges[e][0])], b = nodes[std::size_t(edges[e][1])];
    const bool rises = a < b;  // so that all cells of the edge round alike
    if (!rises) std::swap(a, b);
    for (std::size_t i = 0; i < inner.size(); ++i) {
      const std::int32_t node = nodes[std::size_t(inner[rises ? i : inner.size() - 1 - i])];
      at(mesh, node) = at(mesh, a) + (at(mesh, b) - at(mesh, a)) * double(i + 1) / mesh.order;
    }
  }
}

// === Points in memory ====================================================================================

void NektarPlacing::fail(const std::string& what) const { Scanner(file_.bytes).fail(what); }

/// The nodes of the mesh's order, in Gmsh's order, from the points of a curve in the file's order.
const Eigen::MatrixXd& NektarPlacing::to_nodes(Shape shape, int degree, NektarPoints points) {
  Eigen::MatrixXd& matrix = to_nodes_[{shape, degree, points}];
  if (matrix.size() > 0) return matrix;
  const auto set =
      points == NektarPoints::EvenlySpaced ? reference::NodeSet::Equispaced : reference::NodeSet::Optimised;
  const auto& nodes = reference::nodes(shape, mesh_.order, reference::NodeSet::Equispaced, mesh_.dimension);
  const Eigen::MatrixXd basis = reference::basis_values(shape, degree, set, mesh_.dimension, nodes);
  const std::vector<int>& order = gmsh_nodes(NodeOrder::Nektar, shape, degree);
  matrix.resize(basis.rows(), basis.cols());
  for (std::size_t i = 0; i < order.size(); ++i) matrix.col(Eigen::Index(i)) = basis.col(order[i]);
  // Evenly spaced points of the same order are the nodes.
  if (degree == mesh_.order && set == reference::NodeSet::Equispaced) matrix = matrix.array().round();
  return matrix;
}

void NektarPlacing::place_curve(Shape shape, const NektarCurve& curve, std::span<const std::int32_t> nodes) {
  const int degree = nektar_degree(shape, curve.count);
  Columns points(curve.count, 3);
  for (Eigen::Index k = 0; k < points.rows(); ++k)
    points.row(k) = Eigen::Map<const Eigen::RowVector3d>(file_.point(curve, std::size_t(k)));
  const Columns found = to_nodes(shape, degree, curve.points) * points;
  const Eigen::Index inner = inner_node_count(shape, mesh_.order);
  double gap = 0;
  for (Eigen::Index i = 0; i < found.rows(); ++i) {
    if (i < found.rows() - inner)
      gap = std::max(gap, (found.row(i) - at(nodes[std::size_t(i)])).lpNorm<Eigen::Infinity>());
    else
      at(nodes[std::size_t(i)]) = found.row(i);
  }
  // Files have at least six digits, of the coordinate and not of the curve's size.
  constexpr double kOfSize = 1e-5, kOfCoordinate = 2e-6;
  const double size = (points.colwise().maxCoeff() - points.colwise().minCoeff()).maxCoeff();
  if (!(gap <= std::max(kOfSize * size, kOfCoordinate * points.lpNorm<Eigen::Infinity>())))
    fail("the curve of " + std::string(shape == Shape::Line ? "edge " : "face ") + std::to_string(curve.id) +
         " does not meet its " + (shape == Shape::Line ? "vertices" : "edges"));
}

void NektarPlacing::place_edges(const MfemTopology& topology) {
  std::vector<const NektarCurve*> curve(file_.edge_ids.size());
  for (const NektarCurve& each : file_.curved_edges) {
    const std::int32_t edge = file_.edge_ids.find(each.id);
    if (edge < 0) fail("the curve of edge " + std::to_string(each.id) + " is of an edge that is not in the file");
    curve[std::size_t(edge)] = &each;
  }
  std::vector<std::int32_t> nodes(std::size_t(mesh_.order) + 1);
  for (std::size_t e = 0; e < curve.size(); ++e) {
    const std::array vertices = {std::int32_t(file_.edges[2 * e]), std::int32_t(file_.edges[2 * e + 1])};
    if (!topology.find_nodes(Shape::Line, vertices, 0, nodes)) continue;  // no cell has it
    if (curve[e] != nullptr) {
      place_curve(Shape::Line, *curve[e], nodes);
      continue;
    }
    for (int k = 1; k < mesh_.order; ++k)
      at(nodes[std::size_t(k) + 1]) = at(vertices[0]) + (at(vertices[1]) - at(vertices[0])) * k / mesh_.order;
  }
}

void NektarPlacing::place_faces(const NektarCorners& corners, const MfemTopology& topology, std::vector<bool>& placed) {
  std::vector<std::int32_t> nodes;
  for (const NektarCurve& curve : file_.curved_faces) {
    const auto face = std::size_t(file_.faces.ids.find(curve.id));
    const Shape shape = file_.faces.shapes[face];
    nodes.resize(std::size_t(reference::node_count(shape, mesh_.order)));
    if (!topology.find_nodes(shape, corners.face(face, shape), 0, nodes)) continue;  // no cell has it
    place_curve(shape, curve, nodes);
    for (std::size_t i = nodes.size() - std::size_t(inner_node_count(shape, mesh_.order)); i < nodes.size(); ++i)
      placed[std::size_t(nodes[i])] = true;
  }
}

// === What follows from the boundary ======================================================================

void NektarBlender::blend(const NektarBlending& blending, std::span<const std::int32_t> nodes) {
  const Eigen::Index boundary = blending.inside.cols();
  known_.resize(boundary, 3);
  for (Eigen::Index i = 0; i < boundary; ++i) known_.row(i) = at(mesh_, nodes[std::size_t(i)]);
  found_.noalias() = blending.inside * known_;
  for (Eigen::Index i = 0; i < found_.rows(); ++i) at(mesh_, nodes[std::size_t(boundary + i)]) = found_.row(i);
}

bool NektarBlender::leaves_space(const NektarBlending& blending) const {
  if (blending.outside.rows() == 0) return false;
  constexpr double kRounding = 1e-9;
  const double size = (known_.colwise().maxCoeff() - known_.colwise().minCoeff()).maxCoeff();
  return !((blending.outside * known_).lpNorm<Eigen::Infinity>() <= kRounding * size);
}

}  // namespace varimesh::formats
