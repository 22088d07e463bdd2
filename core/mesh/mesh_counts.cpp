#include "core/mesh/mesh_counts.h"

#include <algorithm>
#include <numeric>

#include "core/base/index.h"
#include "core/mesh/connectivity.h"
#include "core/reference/nodes.h"

namespace varimesh {
namespace {

using reference::NodePlace;

/// Nodes inside an edge, a triangle or a quadrilateral of this order.
std::int64_t inside_edge(int order) { return order - 1; }
std::int64_t inside_triangle(int order) { return std::int64_t{order - 1} * (order - 2) / 2; }
std::int64_t inside_quadrilateral(int order) { return std::int64_t{order - 1} * (order - 1); }

std::int64_t inside_cell(Shape shape, int order) {
  const int dimension = reference::info(shape).dimension;
  return std::ranges::count_if(reference::node_places(shape, order),
                               [&](NodePlace place) { return place.dimension == dimension; });
}

/// The local number of the first node of a place; −1 if it has none.
int first_node(Shape shape, int order, int dimension, int index) {
  const auto& places = reference::node_places(shape, order);
  const auto found = std::ranges::find_if(
      places, [&](NodePlace place) { return place.dimension == dimension && place.index == index; });
  return found == places.end() ? -1 : static_cast<int>(found - places.begin());
}

/// The local number of the last node of an edge; −1 if it has none.
int last_node_of_edge(Shape shape, int order, int edge) {
  const auto& places = reference::node_places(shape, order);
  for (int i = static_cast<int>(places.size()); i-- > 0;)
    if (places[at(i)].dimension == 1 && places[at(i)].index == edge) return i;
  return -1;
}

/// The nodes of order 1 or 2 of one shape: which are in each edge and face, and the node of the mesh that tells whether
/// each is free.
class LowOrderCell {
 public:
  LowOrderCell(Shape shape, int order, int low_order) : info_(reference::info(shape)) {
    for (int v = 0; v < info_.vertices; ++v) add(v, {v});
    for (std::size_t e = 0; e < info_.edges.size(); ++e) {
      std::vector<int> closure{info_.edges[e][0], info_.edges[e][1]};
      edge_teller_.push_back(first_node(shape, order, 1, static_cast<int>(e)));
      edge_last_.push_back(last_node_of_edge(shape, order, static_cast<int>(e)));
      if (low_order == 2) closure.push_back(add(edge_teller_.back(), closure));
      edges_.push_back(std::move(closure));
    }
    if (info_.dimension == 3) add_faces(order, low_order);
    if (low_order == 2 && inside_cell(shape, 2) > 0) add(first_node(shape, order, info_.dimension, 0), {});
  }

  /// Ordered pairs of different free nodes in a cell, by the smallest place that has both. An edge's or face's pairs
  /// are counted in each of its cells.
  struct Pairs {
    std::int64_t in_edges = 0, in_faces = 0, inside = 0;
    std::int64_t in_different_edges = 0;  ///< The same as in_edges, but every edge counts once.
  };
  /// `nodes`: of the cell in the mesh. `is_first(node)`: whether this node of an edge was not asked for before.
  template <class IsFirst>
  void add_pairs(const std::int32_t* nodes, const std::vector<bool>& fixed, const IsFirst& is_first, Pairs& pairs) {
    for (std::size_t i = 0; i < teller_.size(); ++i)
      is_free_[i] = teller_[i] >= 0 ? !fixed[at(nodes[teller_[i]])] : !std::ranges::all_of(around_[i], [&](int v) {
        return fixed[at(nodes[v])];
      }) || around_[i].empty();
    std::int64_t below = 0;
    std::array<std::int64_t, 12> of_edge{};
    for (std::size_t e = 0; e < edges_.size(); ++e) {
      of_edge[e] = pairs_in(edges_[e]);
      below += of_edge[e];
      if (of_edge[e] == 0) continue;
      if (edge_teller_[e] < 0) continue;
      // Cells may run along an edge in different directions, but the smaller of its outer nodes is the same in all.
      if (is_first(std::min(nodes[edge_teller_[e]], nodes[edge_last_[e]]))) pairs.in_different_edges += of_edge[e];
    }
    pairs.in_edges += below;
    for (const Face& face : faces_) {
      std::int64_t in_face = pairs_in(face.nodes);
      for (const int edge : face.edges) in_face -= of_edge[at(edge)];
      pairs.in_faces += in_face;
      below += in_face;
    }
    const std::int64_t all = std::count(is_free_.begin(), is_free_.begin() + std::ssize(teller_), true);
    pairs.inside += all * (all - 1) - below;
  }

 private:
  struct Face {
    std::vector<int> nodes, edges;
  };

  /// `teller`: the node of the mesh's cell that lies in the same place, or −1; then the vertices around it decide.
  int add(int teller, std::vector<int> around) {
    teller_.push_back(teller);
    around_.push_back(std::move(around));
    return static_cast<int>(teller_.size()) - 1;
  }
  void add_faces(int order, int low_order) {
    for (std::size_t f = 0; f < info_.faces.size(); ++f) {
      Face face;
      for (const std::int8_t v : info_.faces[f].vertices)
        if (v >= 0) face.nodes.push_back(v);
      const std::vector<int> vertices = face.nodes;
      for (std::size_t e = 0; e < edges_.size(); ++e) {
        if (!std::ranges::count(vertices, edges_[e][0]) || !std::ranges::count(vertices, edges_[e][1])) continue;
        face.edges.push_back(static_cast<int>(e));
        if (low_order == 2) face.nodes.push_back(edges_[e][2]);
      }
      if (low_order == 2 && vertices.size() == 4)
        face.nodes.push_back(add(first_node(info_.shape, order, 2, static_cast<int>(f)), vertices));
      faces_.push_back(std::move(face));
    }
  }
  std::int64_t pairs_in(const std::vector<int>& nodes) const {
    const std::int64_t count = std::ranges::count_if(nodes, [&](int n) { return is_free_[at(n)]; });
    return count * (count - 1);
  }

  const reference::ShapeInfo& info_;
  std::vector<int> teller_;               // by node
  std::vector<std::vector<int>> around_;  // by node: vertices
  std::vector<std::vector<int>> edges_;   // by edge: nodes
  std::vector<int> edge_teller_;          // by edge: its first node in the mesh's cell; −1 if it has none
  std::vector<int> edge_last_;            // by edge: its last node there
  std::vector<Face> faces_;
  std::array<bool, 27> is_free_{};
};

bool is_cell(const HighOrderMesh& mesh, const ElementBlock& block) {
  return reference::info(block.shape).dimension == mesh.dimension;
}

/// Calls use(block, nodes) for every cell.
template <class Use>
void for_cells(const HighOrderMesh& mesh, const Use& use) {
  for (const ElementBlock& block : mesh.blocks) {
    if (!is_cell(mesh, block)) continue;
    const std::size_t stride = at(reference::node_count(block.shape, block.order));
    for (std::size_t e = 0; e < block.size(); ++e) use(block, block.nodes.data() + e * stride);
  }
}

/// Fixed nodes as far as the elements of one dimension less tell, and how many of these there are, triangles and lines
/// first, quadrilaterals second.
struct Border {
  std::vector<bool> fixed;
  std::int64_t simplices = 0, quadrilaterals = 0;

  explicit Border(const HighOrderMesh& mesh) : fixed(mesh.node_count(), false) {
    for (const ElementBlock& block : mesh.blocks) {
      if (reference::info(block.shape).dimension != mesh.dimension - 1) continue;
      for (const std::int32_t node : block.nodes) fixed[at(node)] = true;
      (block.shape == Shape::Quadrilateral ? quadrilaterals : simplices) += static_cast<std::int64_t>(block.size());
    }
    if (simplices + quadrilaterals > 0) return;
    const Facets all = facets(mesh);
    fixed = fixed_nodes(mesh, all);
    std::size_t facet = 0;
    for_cells(mesh, [&](const ElementBlock& block, const std::int32_t*) {
      for (const reference::Facet& local : reference::info(block.shape).facets)
        if (all.neighbour[facet++] < 0) ++(local.shape == Shape::Quadrilateral ? quadrilaterals : simplices);
    });
  }
};

/// Adds the places of all nodes to the counts, as numbers of nodes.
void tally_nodes(const HighOrderMesh& mesh, const std::vector<bool>& fixed, MeshCounts& counts) {
  std::vector<bool> seen(mesh.node_count(), false);
  std::int64_t used = 0;
  const auto add = [&](const ElementBlock& block, NodePlace place, Places& to) {
    const reference::ShapeInfo& shape = reference::info(block.shape);
    if (place.dimension == shape.dimension) return ++to.cells[at(static_cast<int>(block.shape))];
    if (place.dimension == 0) return ++to.vertices;
    if (place.dimension == 1) return ++to.edges;
    return ++(shape.faces[at(place.index)].shape == Shape::Triangle ? to.triangles : to.quadrilaterals);
  };
  for_cells(mesh, [&](const ElementBlock& block, const std::int32_t* nodes) {
    const auto& places = reference::node_places(block.shape, block.order);
    for (std::size_t i = 0; i < places.size(); ++i) {
      const auto node = at(nodes[i]);
      if (!fixed[node]) add(block, places[i], counts.free_in_cells);
      if (seen[node]) continue;
      seen[node] = true;
      ++used;
      add(block, places[i], counts.all);
      if (!fixed[node]) add(block, places[i], counts.free);
    }
  });
  counts.unused = static_cast<std::int64_t>(mesh.node_count()) - used;
}

/// From numbers of nodes to numbers of places. Places that have no nodes in the mesh's order follow from the cells, the
/// elements on the border and Euler's formula for a body without holes.
void find_places(const HighOrderMesh& mesh, const Border& border, MeshCounts& counts) {
  Places in_cells;
  for (std::size_t s = 0; s < kShapes; ++s) {
    const reference::ShapeInfo& shape = reference::info(static_cast<Shape>(s));
    in_cells.edges += counts.cells[s] * static_cast<std::int64_t>(shape.edges.size());
    for (const reference::Facet& face : shape.faces)
      (face.shape == Shape::Triangle ? in_cells.triangles : in_cells.quadrilaterals) += counts.cells[s];
  }
  const bool is_solid = mesh.dimension == 3;
  const auto divide = [&](std::int64_t inside, auto&& part) {
    for (Places* places : {&counts.all, &counts.free, &counts.free_in_cells})
      if (inside > 0) part(*places) /= inside;
  };
  divide(inside_edge(mesh.order), [](Places& p) -> std::int64_t& { return p.edges; });
  divide(inside_triangle(mesh.order), [](Places& p) -> std::int64_t& { return p.triangles; });
  divide(inside_quadrilateral(mesh.order), [](Places& p) -> std::int64_t& { return p.quadrilaterals; });
  // A facet inside the mesh has two cells, one on the border has one.
  const auto facets_of = [&](std::int64_t sum, std::int64_t on_border, auto&& part) {
    part(counts.all) = (sum + on_border) / 2;
    part(counts.free) = std::max<std::int64_t>(0, sum - on_border) / 2;
    part(counts.free_in_cells) = std::max<std::int64_t>(0, sum - on_border);
  };
  if (is_solid && mesh.order < 3)
    facets_of(in_cells.triangles, border.simplices, [](Places& p) -> std::int64_t& { return p.triangles; });
  if (is_solid && mesh.order < 2)
    facets_of(in_cells.quadrilaterals, border.quadrilaterals,
              [](Places& p) -> std::int64_t& { return p.quadrilaterals; });
  if (mesh.order < 2 && !is_solid)
    facets_of(in_cells.edges, border.simplices, [](Places& p) -> std::int64_t& { return p.edges; });
  if (mesh.order < 2 && is_solid) {
    const std::int64_t faces = counts.all.triangles + counts.all.quadrilaterals;
    const std::int64_t on_border =
        counts.all.vertices - counts.free.vertices + border.simplices + border.quadrilaterals - 2;
    counts.all.edges = std::max<std::int64_t>(1, counts.all.vertices + faces - counts.cell_count() - 1);
    counts.free.edges = std::max<std::int64_t>(0, counts.all.edges - on_border);
    counts.free_in_cells.edges = in_cells.edges / counts.all.edges * counts.free.edges;
  }
  for (std::size_t s = 0; s < kShapes; ++s)
    counts.all.cells[s] = counts.free.cells[s] = counts.free_in_cells.cells[s] = counts.cells[s];
}

/// MeshCounts::neighbours for one order. Expects the places.
std::int64_t count_neighbours(const HighOrderMesh& mesh, const std::vector<bool>& fixed, int low_order,
                              const MeshCounts& counts) {
  std::vector<bool> seen(mesh.node_count(), false);
  const auto is_first = [&](std::int32_t node) {
    const bool was_seen = seen[at(node)];
    seen[at(node)] = true;
    return !was_seen;
  };
  LowOrderCell::Pairs pairs;
  for (const ElementBlock& block : mesh.blocks) {
    if (!is_cell(mesh, block)) continue;
    LowOrderCell cell(block.shape, block.order, low_order);
    const std::size_t stride = at(reference::node_count(block.shape, block.order));
    for (std::size_t e = 0; e < block.size(); ++e)
      cell.add_pairs(block.nodes.data() + e * stride, fixed, is_first, pairs);
  }
  if (mesh.order > 1) return pairs.inside + pairs.in_faces / 2 + pairs.in_different_edges;
  // Edges have no nodes to know them by: of all edges the mean number of cells.
  double cells_per_edge = 2;
  if (mesh.dimension == 3) {
    std::int64_t in_cells = 0;
    for (std::size_t s = 0; s < kShapes; ++s)
      in_cells += counts.cells[s] * static_cast<std::int64_t>(reference::info(static_cast<Shape>(s)).edges.size());
    cells_per_edge = static_cast<double>(in_cells) / static_cast<double>(std::max<std::int64_t>(1, counts.all.edges));
  }
  return pairs.inside + pairs.in_faces / 2 +
         static_cast<std::int64_t>(static_cast<double>(pairs.in_edges) / std::max(1.0, cells_per_edge));
}

}  // namespace

std::int64_t Places::nodes(int order) const {
  std::int64_t sum = vertices + edges * inside_edge(order) + triangles * inside_triangle(order) +
                     quadrilaterals * inside_quadrilateral(order);
  for (std::size_t s = 0; s < kShapes; ++s)
    if (cells[s] > 0) sum += cells[s] * inside_cell(static_cast<Shape>(s), order);
  return sum;
}

std::int64_t MeshCounts::cell_count() const { return std::accumulate(cells.begin(), cells.end(), std::int64_t{0}); }

MeshCounts count(const HighOrderMesh& mesh, int order) {
  MeshCounts counts;
  counts.dimension = mesh.dimension;
  counts.order = order;
  for (const ElementBlock& block : mesh.blocks)
    (is_cell(mesh, block) ? counts.cells : counts.others)[at(static_cast<int>(block.shape))] +=
        static_cast<std::int64_t>(block.size());
  const Border border(mesh);
  tally_nodes(mesh, border.fixed, counts);
  find_places(mesh, border, counts);
  for (int low_order = 1; low_order <= std::min(order, 2); ++low_order)
    counts.neighbours[at(low_order)] = count_neighbours(mesh, border.fixed, low_order, counts);
  return counts;
}

std::int64_t bytes_of_mesh(const MeshCounts& counts) {
  std::int64_t bytes = counts.nodes() * std::int64_t{3 * sizeof(double) + sizeof(std::int64_t)};
  for (std::size_t s = 0; s < kShapes; ++s) {
    const auto shape = static_cast<Shape>(s);
    const std::int64_t elements = counts.cells[s] + counts.others[s];
    if (elements > 0)
      bytes += elements * (std::int64_t{sizeof(std::int64_t)} +
                           std::int64_t{sizeof(std::int32_t)} * reference::node_count(shape, counts.order));
  }
  return bytes;
}

std::int64_t bytes_of_check(const MeshCounts& counts) {
  std::int64_t facets = 0;
  for (std::size_t s = 0; s < kShapes; ++s)
    facets += counts.cells[s] * static_cast<std::int64_t>(reference::info(static_cast<Shape>(s)).facets.size());
  // What is across each facet, where each node's facets begin, and the entries of one range of nodes.
  const std::int64_t matching = 4 * counts.cell_count() + 8 * facets + 4 * counts.nodes() +
                                16 * std::min<std::int64_t>(facets, std::int64_t{1} << 21);
  return std::max({matching, 8 * counts.nodes(), 16 * counts.cell_count()});
}

}  // namespace varimesh
