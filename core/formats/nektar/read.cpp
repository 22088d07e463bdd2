// Makes a mesh of the lists of a Nektar++ file.
#include <algorithm>
#include <cmath>
#include <map>

#include "core/formats/format_table.h"
#include "core/formats/mfem/space.h"
#include "core/formats/mfem/topology.h"
#include "core/formats/nektar/blending.h"
#include "core/formats/nektar/composites.h"
#include "core/formats/nektar/corners.h"
#include "core/formats/nektar/file.h"
#include "core/formats/nektar/nektar.h"
#include "core/formats/node_order.h"
#include "core/formats/scanner.h"
#include "core/reference/basis.h"
#include "core/reference/nodes.h"

namespace varimesh::formats {

namespace {

using Columns = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// The degree of a curve with this many points; 0 if there is none. `shape`: a line, or the shape of a face.
int degree_of(Shape shape, std::int64_t points) {
  for (int degree = 1; degree <= kMaxOrder; ++degree)
    if (points == reference::node_count(shape, degree)) return degree;
  return 0;
}

class Reading {
 public:
  Reading(NektarFile file, FileAllowance& allowance, const Team& team)
      : file_(std::move(file)), allowance_(allowance), team_(team) {}

  HighOrderMesh take() {
    mesh_.dimension = file_.dimension;
    mesh_.order = order();
    vertices_ = nektar_corners(file_, allowance_);
    const MfemTopology topology = make_topology();
    allocate(topology);
    std::copy(file_.vertices.begin(), file_.vertices.end(), mesh_.coordinates.begin());
    free_memory(file_.vertices);
    place_edges(topology);
    if (mesh_.dimension == 3) {
      free_memory(file_.edges);
      free_memory(file_.curved_edges);
      if (file_.curved_faces.empty()) free_memory(file_.points);
      place_faces(topology);
      free_memory(file_.points);
      free_memory(file_.index);
      free_memory(file_.curved_faces);
    }
    place_cells(topology);
    make_blocks(topology);
    mesh_.foreign = std::move(file_.others);
    return std::move(mesh_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { Scanner(file_.bytes).fail(what); }

  int order() const {
    int order = 1;
    for (const NektarCurve& curve : file_.curved_edges) order = std::max(order, checked_degree(Shape::Line, curve));
    const NektarParts& faces = mesh_.dimension == 3 ? file_.faces : file_.elements;
    for (const NektarCurve& curve : file_.curved_faces) {
      const std::int32_t face = faces.ids.find(curve.id);
      if (face < 0) fail("the curve of face " + std::to_string(curve.id) + " is of a face that is not in the file");
      order = std::max(order, checked_degree(faces.shapes[std::size_t(face)], curve));
    }
    return order;
  }

  int checked_degree(Shape shape, const NektarCurve& curve) const {
    const std::string name = (shape == Shape::Line ? "edge " : "face ") + std::to_string(curve.id);
    const int degree = degree_of(shape, curve.count);
    if (degree == 0)
      fail("the curve of " + name + " has " + std::to_string(curve.count) + " points, which no " +
           std::string(reference::info(shape).name) + " of order 1 to " + std::to_string(kMaxOrder) + " has");
    const bool other = curve.points == NektarPoints::OtherTriangle;
    if (other && shape != Shape::Triangle) fail("the curve of " + name + " has points that are for triangles");
    if (other && degree > 3)
      fail("the curve of " + name +
           " has electrostatic or Fekete points of order 4 or above; VariMesh reads evenly spaced ones, so give it the "
           "mesh from which NekMesh made this file");
    if (!other && shape == Shape::Triangle && curve.points == NektarPoints::GaussLobatto)
      fail("the curve of " + name + " has points of a square on a triangle; VariMesh reads NodalTriEvenlySpaced");
    return degree;
  }

  /// Calls body(element, shape, vertices) for each cell.
  template <class Body>
  void for_each_cell(const Body& body) const {
    const std::int32_t* vertices = vertices_.cells.data();
    for (std::size_t e = 0; e < file_.elements.shapes.size(); ++e) {
      const Shape shape = file_.elements.shapes[e];
      const auto count = std::size_t(reference::info(shape).vertices);
      body(e, shape, std::span(vertices, count));
      vertices += count;
    }
  }

  // === Nodes =============================================================================================

  MfemTopology make_topology() {
    if (file_.vertex_ids.size() > std::size_t(kMostNodes)) fail("it has too many vertices");
    Scanner counted(file_.bytes);
    counted.allowance = allowance_.counted();
    // Where the vertices of every kStep-th cell begin, because shapes have different numbers of vertices.
    constexpr std::size_t kStep = 1024;
    std::vector<std::size_t> first;
    std::size_t vertices = 0;
    for (std::size_t e = 0; e < file_.elements.shapes.size(); ++e) {
      if (e % kStep == 0) first.push_back(vertices);
      vertices += std::size_t(reference::info(file_.elements.shapes[e]).vertices);
    }
    const auto visit = [&](std::size_t begin, std::size_t end, const MfemCells::Body& body) {
      const std::int32_t* own = vertices_.cells.data() + first[begin / kStep];
      for (std::size_t e = begin / kStep * kStep; e < end; ++e) {
        const Shape shape = file_.elements.shapes[e];
        const auto count = std::size_t(reference::info(shape).vertices);
        if (e >= begin) body(e, shape, {own, count});
        own += count;
      }
    };
    return MfemTopology(mesh_.dimension, mesh_.order, std::int32_t(file_.vertex_ids.size()),
                        {file_.elements.shapes.size(), visit}, team_, &counted);
  }

  /// Takes the memory of all nodes, and finds where the inner ones of each cell begin.
  void allocate(const MfemTopology& topology) {
    std::int64_t nodes = topology.interior_first(), of_elements = 0;
    for (const Shape shape : file_.elements.shapes) {
      nodes += inner_node_count(shape, mesh_.order);
      of_elements += reference::node_count(shape, mesh_.order);
    }
    if (nodes > kMostNodes) fail("it has " + std::to_string(nodes) + " nodes, more than VariMesh takes");
    allowance_.take(std::size_t(nodes), 3 * sizeof(double) + sizeof(std::int64_t));
    allowance_.take(std::size_t(of_elements), sizeof(std::int32_t));
    mesh_.coordinates.resize(3 * std::size_t(nodes));
    mesh_.node_numbers.resize(std::size_t(nodes));
    for (std::size_t i = 0; i < mesh_.node_numbers.size(); ++i) mesh_.node_numbers[i] = std::int64_t(i) + 1;
    mesh_.node_blocks = {{-1, 0, 0, std::int32_t(nodes)}};
  }

  Eigen::Map<Eigen::RowVector3d> at(std::int32_t node) {
    return Eigen::Map<Eigen::RowVector3d>(mesh_.coordinates.data() + 3 * std::ptrdiff_t(node));
  }

  /// The nodes of the mesh's order, in Gmsh's order, from the points of a curve in the file's order.
  const Eigen::MatrixXd& to_nodes(Shape shape, int degree, NektarPoints points) {
    Eigen::MatrixXd& matrix = to_nodes_[{shape, degree, points}];
    if (matrix.size() > 0) return matrix;
    const auto set =
        points == NektarPoints::EvenlySpaced ? reference::NodeSet::Equispaced : reference::NodeSet::Optimised;
    const auto& at = reference::nodes(shape, mesh_.order, reference::NodeSet::Equispaced, mesh_.dimension);
    const Eigen::MatrixXd basis = reference::basis_values(shape, degree, set, mesh_.dimension, at);
    const std::vector<int>& order = gmsh_nodes(NodeOrder::Nektar, shape, degree);
    matrix.resize(basis.rows(), basis.cols());
    for (std::size_t i = 0; i < order.size(); ++i) matrix.col(Eigen::Index(i)) = basis.col(order[i]);
    // Evenly spaced points of the same order are the nodes.
    if (degree == mesh_.order && set == reference::NodeSet::Equispaced) matrix = matrix.array().round();
    return matrix;
  }

  /// Places the inner nodes of a curved edge or face, whose vertices and, if it is a face, edges are in place.
  void place_curve(Shape shape, const NektarCurve& curve, std::span<const std::int32_t> nodes) {
    const int degree = degree_of(shape, curve.count);
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

  /// Places the inner nodes that follow from those on the boundary.
  void blend(const NektarBlending& blending, std::span<const std::int32_t> nodes) {
    const Eigen::Index boundary = blending.inside.cols();
    known_.resize(boundary, 3);
    for (Eigen::Index i = 0; i < boundary; ++i) known_.row(i) = at(nodes[std::size_t(i)]);
    found_.noalias() = blending.inside * known_;
    for (Eigen::Index i = 0; i < found_.rows(); ++i) at(nodes[std::size_t(boundary + i)]) = found_.row(i);
  }

  void place_edges(const MfemTopology& topology) {
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

  void place_faces(const MfemTopology& topology) {
    std::vector<const NektarCurve*> curve(file_.faces.ids.size());
    for (const NektarCurve& each : file_.curved_faces) curve[std::size_t(file_.faces.ids.find(each.id))] = &each;
    std::vector<std::int32_t> nodes;
    for (std::size_t f = 0; f < curve.size(); ++f) {
      const Shape shape = file_.faces.shapes[f];
      nodes.resize(std::size_t(reference::node_count(shape, mesh_.order)));
      const std::span own(vertices_.faces[f].data(), std::size_t(reference::info(shape).vertices));
      if (!topology.find_nodes(shape, own, 0, nodes)) continue;  // no cell has it
      if (curve[f] != nullptr)
        place_curve(shape, *curve[f], nodes);
      else
        blend(nektar_blending(shape, mesh_.order), nodes);
    }
  }

  void place_cells(const MfemTopology& topology) {
    std::map<std::int32_t, const NektarCurve*> curve;
    if (mesh_.dimension == 2)
      for (const NektarCurve& each : file_.curved_faces) curve[file_.elements.ids.find(each.id)] = &each;
    std::int64_t interior = topology.interior_first();
    std::vector<std::int32_t> nodes;
    for_each_cell([&](std::size_t e, Shape shape, std::span<const std::int32_t> vertices) {
      nodes.resize(std::size_t(reference::node_count(shape, mesh_.order)));
      (void)topology.find_nodes(shape, vertices, std::int32_t(interior), nodes);
      interior += inner_node_count(shape, mesh_.order);
      if (const auto found = curve.find(std::int32_t(e)); found != curve.end())
        return place_curve(shape, *found->second, nodes);
      const NektarBlending& blending = nektar_blending(shape, mesh_.order);
      blend(blending, nodes);
      if (blending.outside.rows() > 0) check_outside(blending, e);
    });
  }

  void check_outside(const NektarBlending& blending, std::size_t element) const {
    constexpr double kRounding = 1e-9;
    const double size = (known_.colwise().maxCoeff() - known_.colwise().minCoeff()).maxCoeff();
    if ((blending.outside * known_).lpNorm<Eigen::Infinity>() <= kRounding * size) return;
    fail("pyramid " + std::to_string(file_.elements.ids[element]) +
         " has a base that is curved in a way that Nektar++ continues inside the pyramid with a higher order than " +
         std::to_string(mesh_.order) + ", which VariMesh cannot certify; give VariMesh the mesh before NekMesh");
  }

  // === Elements ==========================================================================================

  /// Cells in the file's order, then the boundary elements of each composite.
  void make_blocks(const MfemTopology& topology) {
    const NektarGroups groups = nektar_groups(file_, allowance_);
    std::int64_t interior = topology.interior_first(), number = 0;
    std::size_t run_end = 0;
    for_each_cell([&](std::size_t e, Shape shape, std::span<const std::int32_t> vertices) {
      if (e >= run_end) {  // a new block begins
        while (run_end < file_.elements.shapes.size() && file_.elements.shapes[run_end] == shape &&
               groups.of_elements[run_end] == groups.of_elements[e])
          ++run_end;
        room_ = run_end - e;
      }
      add_element(topology, shape, vertices, std::int32_t(interior), groups.lists[std::size_t(groups.of_elements[e])],
                  ++number);
      interior += inner_node_count(shape, mesh_.order);
    });
    for (const auto& [item, tags] : groups.of_sides) {
      if (mesh_.dimension == 2) {
        const std::array own = {std::int32_t(file_.edges[2 * std::size_t(item)]),
                                std::int32_t(file_.edges[2 * std::size_t(item) + 1])};
        add_element(topology, Shape::Line, own, 0, tags, ++number);
      } else {
        const Shape shape = file_.faces.shapes[std::size_t(item)];
        const std::span own(vertices_.faces[std::size_t(item)].data(), std::size_t(reference::info(shape).vertices));
        add_element(topology, shape, own, 0, tags, ++number);
      }
    }
    mesh_.physical_groups = groups.named;
  }

  void add_element(const MfemTopology& topology, Shape shape, std::span<const std::int32_t> vertices,
                   std::int32_t interior, const std::vector<int>& tags, std::int64_t number) {
    const bool same =
        !mesh_.blocks.empty() && mesh_.blocks.back().shape == shape && mesh_.blocks.back().physical == tags;
    if (!same) {
      ElementBlock fresh;
      fresh.shape = shape;
      fresh.order = mesh_.order;
      fresh.entity = tags.empty() ? 1 : tags.front();
      fresh.physical = tags;
      allowance_.take(1, sizeof(ElementBlock));
      fresh.numbers.reserve(room_);
      fresh.nodes.reserve(room_ * std::size_t(reference::node_count(shape, mesh_.order)));
      room_ = 0;
      mesh_.blocks.push_back(std::move(fresh));
    }
    ElementBlock& block = mesh_.blocks.back();
    allowance_.take(1, 16);
    block.numbers.push_back(number);
    const std::size_t first = block.nodes.size(), count = std::size_t(reference::node_count(shape, mesh_.order));
    block.nodes.resize(first + count);
    if (!topology.find_nodes(shape, vertices, interior, {block.nodes.data() + first, count}))
      fail("a composite has a side that belongs to no element");
  }

  NektarFile file_;
  FileAllowance& allowance_;
  const Team& team_;
  HighOrderMesh mesh_;
  NektarCorners vertices_;
  std::size_t room_ = 0;  ///< Elements that the next block is known to get.
  std::map<std::tuple<Shape, int, NektarPoints>, Eigen::MatrixXd> to_nodes_;
  Columns known_, found_;
};

}  // namespace

bool begins_like_nektar(std::string_view bytes) { return begins_with_element(bytes, "NEKTAR"); }

Expected<MeshFile> read_nektar(std::string_view bytes, const Team& team) {
  FileAllowance allowance(bytes.size(), team.stop());
  NektarFile file = parse_nektar(bytes, allowance);
  if (!file.compressed) file.others.push_back({std::string(kNektarText), "", "nektar"});
  if (file.elements.ids.size() == 0) Scanner(bytes).fail("it has no elements");
  return MeshFile{Reading(std::move(file), allowance, team).take(), Format::Nektar};
}

}  // namespace varimesh::formats
