// Cells of a 2-D mesh as closed paths of cubic Bézier curves, each edge once.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "client/report/scene.h"
#include "core/reference/basis.h"
#include "core/reference/nodes.h"

namespace varimesh::client {
namespace {

using Json = nlohmann::ordered_json;

/// Cubic curves that an edge of that order is cut into. Up to order 3 one is exact; beyond, each piece takes the values
/// and tangents at its ends, which leaves an error of the fourth power of its length.
int pieces_of(int order) { return order <= 3 ? 1 : (order + 1) / 2; }

/// Matrix from an edge's nodes to the 3 pieces + 1 control points of its curves.
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

/// An edge, by the first cell that has it.
struct Edge {
  std::size_t cell;
  const std::vector<int>* nodes;  ///< Local to the cell.
};

/// Of meshes with more edges, bends are told in eight bits: to a hundredth of themselves.
constexpr std::size_t kManyEdges = 100'000;

/// The inner control points relative to equal steps along the chord, in sixteen or eight bits of the largest of them.
template <class Step>
class Bends {
 public:
  Bends(const Stages& stages, std::size_t stage, const Eigen::MatrixXd& matrix)
      : stages_(stages), stage_(stage), matrix_(matrix) {}

  void add(const Edge& edge) {
    Eigen::MatrixXd nodes(matrix_.cols(), 2);
    for (int i = 0; i < nodes.rows(); ++i) {
      const auto at = stages_.point(stage_, edge.cell, (*edge.nodes)[static_cast<std::size_t>(i)]);
      nodes.row(i) << at[0] - stages_.centre()[0], at[1] - stages_.centre()[1];
    }
    Eigen::MatrixXd bends = matrix_ * nodes;
    const auto last = bends.rows() - 1;
    for (Eigen::Index k = 1; k < last; ++k) {
      const double t = static_cast<double>(k) / static_cast<double>(last);
      bends.row(k) -= (1 - t) * nodes.row(0) + t * nodes.row(1);
    }
    const double length = (nodes.row(1) - nodes.row(0)).norm();
    double largest = bends.middleRows(1, last - 1).cwiseAbs().maxCoeff();
    if (largest <= 1e-9 * length) largest = 0;  // straight
    scales.push_back(static_cast<float>(largest / kMost));
    for (Eigen::Index k = 1; k < last; ++k)
      for (int d = 0; d < 2; ++d)
        steps.push_back(static_cast<Step>(largest > 0 ? std::lround(bends(k, d) / largest * kMost) : 0));
  }

  std::vector<float> scales;
  std::vector<Step> steps;

 private:
  static constexpr int kMost = std::numeric_limits<Step>::max();

  const Stages& stages_;
  const std::size_t stage_;
  const Eigen::MatrixXd& matrix_;
};

template <class Step>
void pack_bends(Bends<Step> bends, const std::vector<Edge>& edges, const std::string& stage, Packing* packing) {
  for (const Edge& edge : edges) bends.add(edge);
  packing->add("bend_scales_" + stage, bends.scales);
  packing->add("bends_" + stage, bends.steps);
}

}  // namespace

Json pack_cells_2d(const Stages& stages, Packing* packing, std::vector<std::int32_t>* shown) {
  const Cells& cells = stages.cells();
  const int order = stages.mesh().order;
  const Facets sides = facets(stages.mesh());
  std::vector<Edge> edges;
  std::vector<std::int32_t> edge_of(sides.neighbour.size(), -1);
  std::vector<std::int32_t> vertex_of(stages.mesh().node_count(), -1);
  std::vector<std::pair<std::size_t, int>> vertices;  // cell and local number
  std::vector<std::int32_t> ends, cell_edges;
  std::vector<std::uint8_t> cell_sides;
  for (std::size_t c = 0; c < cells.count(); ++c) {
    shown->push_back(static_cast<std::int32_t>(c));
    const Shape shape = cells.shape(c);
    const auto count = reference::info(shape).facets.size();
    cell_sides.push_back(static_cast<std::uint8_t>(count));
    for (std::size_t f = 0; f < count; ++f) {
      const auto side = static_cast<std::size_t>(sides.first[c]) + f;
      const std::vector<int>& local = reference::facet_nodes(shape, order, static_cast<int>(f));
      std::int32_t from_to[2];
      for (std::size_t end = 0; end < 2; ++end) {
        std::int32_t& vertex =
            vertex_of[static_cast<std::size_t>(cells.nodes(c)[static_cast<std::size_t>(local[end])])];
        if (vertex < 0) {
          vertex = static_cast<std::int32_t>(vertices.size());
          vertices.emplace_back(c, local[end]);
        }
        from_to[end] = vertex;
      }
      if (const std::int32_t opposite = sides.opposite[side]; opposite >= 0)
        edge_of[side] = edge_of[static_cast<std::size_t>(opposite)];
      if (edge_of[side] < 0) {
        edge_of[side] = static_cast<std::int32_t>(edges.size());
        edges.push_back({c, &local});
        ends.insert(ends.end(), from_to, from_to + 2);
      }
      // Edge e forwards is e + 1, backwards −(e + 1).
      const std::int32_t edge = edge_of[side];
      cell_edges.push_back(ends[2 * static_cast<std::size_t>(edge)] == from_to[0] ? edge + 1 : -(edge + 1));
    }
  }
  packing->add("edge_ends", ends);
  packing->add("cell_edges", cell_edges);
  packing->add("cell_sides", cell_sides);

  const Eigen::MatrixXd matrix = control_points(order);
  for (std::size_t s = 0; s < stages.count(); ++s) {
    std::vector<float> places;
    for (const auto& [cell, local] : vertices)
      for (std::size_t d = 0; d < 2; ++d)
        places.push_back(static_cast<float>(stages.point(s, cell, local)[d] - stages.centre()[d]));
    const std::string name = Stages::name(s);
    packing->add("vertices_" + name, places);
    if (edges.size() > kManyEdges)
      pack_bends(Bends<std::int8_t>(stages, s, matrix), edges, name, packing);
    else
      pack_bends(Bends<std::int16_t>(stages, s, matrix), edges, name, packing);
  }
  return {{"pieces", pieces_of(order)}};
}

}  // namespace varimesh::client
