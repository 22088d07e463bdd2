// The cells of a 2-D mesh as closed paths of cubic Bézier curves. Each edge is stored once.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>

#include "client/report/scene.h"
#include "core/reference/basis.h"
#include "core/reference/nodes.h"

namespace varimesh::client {
namespace {

using Json = nlohmann::ordered_json;

/// The number of cubic curves for an edge of this order. Up to order 3, one curve is exact. Beyond, each curve has the
/// values and tangents of the edge at its ends, so its error is of the fourth order in its length.
int pieces_of(int order) { return order <= 3 ? 1 : (order + 1) / 2; }

/// The matrix from the nodes of an edge to the control points of its curves: 3 pieces + 1 rows, order + 1 columns.
Eigen::MatrixXd control_points(int order) {
  const int pieces = pieces_of(order);
  reference::Points ends(pieces + 1, 1);
  for (int k = 0; k <= pieces; ++k) ends(k, 0) = -1 + 2.0 * k / pieces;
  const auto values = reference::basis_values(Shape::Line, order, reference::NodeSet::Equispaced, 2, ends);
  const auto slopes = reference::basis_gradients(Shape::Line, order, reference::NodeSet::Equispaced, 2, ends)[0];
  const double third = 2.0 / pieces / 3;
  Eigen::MatrixXd matrix(3 * pieces + 1, values.cols());
  for (int k = 0; k <= pieces; ++k) {
    matrix.row(3 * k) = values.row(k);
    if (k > 0) matrix.row(3 * k - 1) = values.row(k) - third * slopes.row(k);
    if (k < pieces) matrix.row(3 * k + 1) = values.row(k) + third * slopes.row(k);
  }
  return matrix;
}

/// An edge, as a side of the first cell that has it.
struct Edge {
  std::size_t cell;
  const std::vector<int>* nodes;  ///< Their local numbers in the cell, the two ends first.
};

/// In meshes with more edges, bends have eight bits instead of sixteen, which is about a hundredth of the largest bend.
constexpr std::size_t kManyEdges = 100'000;

/// Bends: the inner control points of edges relative to equal steps along the chord. Each edge has a scale, and its
/// bends are integers of the type Step in units of that scale.
template <class Step>
class Bends {
 public:
  Bends(const Snapshots& snapshots, std::size_t snapshot, const Eigen::MatrixXd& matrix)
      : snapshots_(snapshots), snapshot_(snapshot), matrix_(matrix) {}

  void add(const Edge& edge) {
    Eigen::MatrixXd nodes(matrix_.cols(), 2);
    for (int i = 0; i < nodes.rows(); ++i) {
      const auto node = snapshots_.point(snapshot_, edge.cell, (*edge.nodes)[static_cast<std::size_t>(i)]);
      nodes.row(i) << node[0] - snapshots_.centre()[0], node[1] - snapshots_.centre()[1];
    }
    Eigen::MatrixXd bends = matrix_ * nodes;
    const auto last = bends.rows() - 1;
    for (Eigen::Index k = 1; k < last; ++k) {
      const double t = static_cast<double>(k) / static_cast<double>(last);
      bends.row(k) -= (1 - t) * nodes.row(0) + t * nodes.row(1);
    }
    const double length = (nodes.row(1) - nodes.row(0)).norm();
    double largest = bends.middleRows(1, last - 1).cwiseAbs().maxCoeff();
    if (largest <= 1e-9 * length) largest = 0;  // The edge is straight.
    scales.push_back(static_cast<float>(largest / kMost));
    for (Eigen::Index k = 1; k < last; ++k)
      for (int d = 0; d < 2; ++d)
        steps.push_back(static_cast<Step>(largest > 0 ? std::lround(bends(k, d) / largest * kMost) : 0));
  }

  std::vector<float> scales;
  std::vector<Step> steps;

 private:
  static constexpr int kMost = std::numeric_limits<Step>::max();

  const Snapshots& snapshots_;
  const std::size_t snapshot_;
  const Eigen::MatrixXd& matrix_;
};

template <class Step>
void pack_bends(Bends<Step> bends, const std::vector<Edge>& edges, const std::string& snapshot, Packing* packing) {
  for (const Edge& edge : edges) bends.add(edge);
  packing->add("bend_scales_" + snapshot, bends.scales);
  packing->add("bends_" + snapshot, bends.steps);
}

/// The edges and vertices of a mesh, each once, and the cells as closed sequences of edges.
class EdgeTable {
 public:
  explicit EdgeTable(const Snapshots& snapshots)
      : cells_(snapshots.cells()),
        order_(snapshots.mesh().order),
        sides_(facets(snapshots.mesh())),
        edge_of_side_(sides_.neighbour.size(), -1),
        vertex_of_node_(snapshots.mesh().node_count(), -1) {
    for (std::size_t c = 0; c < cells_.count(); ++c) add_cell(c);
  }

  std::vector<Edge> edges;
  std::vector<std::pair<std::size_t, int>> vertices;  ///< Of each vertex: a cell, and its local number there.
  std::vector<std::int32_t> ends;                     ///< Of each edge: its two vertices.
  std::vector<std::int32_t> cell_edges;  ///< Of each side of each cell: e + 1 for edge e, −(e + 1) for it backwards.
  std::vector<std::uint8_t> cell_sides;  ///< Of each cell: the number of its sides.

 private:
  void add_cell(std::size_t c) {
    const auto count = reference::info(cells_.shape(c)).facets.size();
    cell_sides.push_back(static_cast<std::uint8_t>(count));
    for (std::size_t f = 0; f < count; ++f) add_side(c, static_cast<int>(f));
  }

  void add_side(std::size_t c, int f) {
    const auto side = static_cast<std::size_t>(sides_.first[c]) + static_cast<std::size_t>(f);
    const std::vector<int>& nodes = reference::facet_nodes(cells_.shape(c), order_, f);
    const std::int32_t from_to[2] = {vertex(c, nodes[0]), vertex(c, nodes[1])};
    if (const std::int32_t opposite = sides_.opposite[side]; opposite >= 0)
      edge_of_side_[side] = edge_of_side_[static_cast<std::size_t>(opposite)];
    if (edge_of_side_[side] < 0) {
      edge_of_side_[side] = static_cast<std::int32_t>(edges.size());
      edges.push_back({c, &nodes});
      ends.insert(ends.end(), from_to, from_to + 2);
    }
    const std::int32_t edge = edge_of_side_[side];
    cell_edges.push_back(ends[2 * static_cast<std::size_t>(edge)] == from_to[0] ? edge + 1 : -(edge + 1));
  }

  /// The vertex that is node number `local` of a cell; a new one if it has none yet.
  std::int32_t vertex(std::size_t c, int local) {
    const auto node = static_cast<std::size_t>(cells_.nodes(c)[static_cast<std::size_t>(local)]);
    if (vertex_of_node_[node] < 0) {
      vertex_of_node_[node] = static_cast<std::int32_t>(vertices.size());
      vertices.emplace_back(c, local);
    }
    return vertex_of_node_[node];
  }

  const Cells& cells_;
  const int order_;
  const Facets sides_;
  std::vector<std::int32_t> edge_of_side_, vertex_of_node_;  ///< −1: none yet.
};

void pack_snapshot(const Snapshots& snapshots, std::size_t snapshot, const EdgeTable& table,
                   const Eigen::MatrixXd& matrix, Packing* packing) {
  std::vector<float> places;
  for (const auto& [cell, local] : table.vertices)
    for (std::size_t d = 0; d < 2; ++d)
      places.push_back(static_cast<float>(snapshots.point(snapshot, cell, local)[d] - snapshots.centre()[d]));
  const std::string name = Snapshots::name(snapshot);
  packing->add("vertices_" + name, places);
  if (table.edges.size() > kManyEdges)
    pack_bends(Bends<std::int8_t>(snapshots, snapshot, matrix), table.edges, name, packing);
  else
    pack_bends(Bends<std::int16_t>(snapshots, snapshot, matrix), table.edges, name, packing);
}

}  // namespace

Json pack_cells_2d(const Snapshots& snapshots, Packing* packing, std::vector<std::int32_t>* shown) {
  shown->resize(snapshots.cells().count());
  std::iota(shown->begin(), shown->end(), 0);
  const EdgeTable table(snapshots);
  packing->add("edge_ends", table.ends);
  packing->add("cell_edges", table.cell_edges);
  packing->add("cell_sides", table.cell_sides);
  const int order = snapshots.mesh().order;
  const Eigen::MatrixXd matrix = control_points(order);
  for (std::size_t s = 0; s < snapshots.count(); ++s) pack_snapshot(snapshots, s, table, matrix, packing);
  return {{"pieces", pieces_of(order)}};
}

}  // namespace varimesh::client
