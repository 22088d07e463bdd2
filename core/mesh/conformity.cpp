// Two elements that share a facet must have the same nodes there, each at the same position of the facet's lattice.
#include "core/mesh/conformity.h"

#include <algorithm>
#include <array>
#include <map>

#include "core/base/shared_work.h"
#include "core/reference/nodes.h"

namespace varimesh {

namespace {

constexpr std::size_t kCellsPerTask = 2048, kFacetsPerTask = 16384, kEdgesPerTask = 1024;

// How the nodes of a facet as one cell orders them correspond to those as the other cell orders them, for each way in
// which the vertices can correspond. A lattice node is identified by its weights at the vertices: barycentric on lines
// and triangles, bilinear on quadrilaterals.
class FacetMaps {
 public:
  explicit FacetMaps(int order) : order_(order) {}

  /// The number in the second order of each node of the first order, if vertex k of the first order is vertex turn[k]
  /// of the second. Empty if `turn` is not a symmetry of the shape.
  const std::vector<int>& map(Shape shape, const std::array<int, 4>& turn) {
    if (shape == last_shape_ && turn == last_turn_) return *last_;
    auto [at, is_new] = maps_.try_emplace({shape, turn});
    if (is_new) at->second = make(shape, turn);
    last_shape_ = shape;
    last_turn_ = turn;
    last_ = &at->second;
    return at->second;
  }

 private:
  std::array<int, 4> weights(Shape shape, const std::array<std::int8_t, 3>& at) const {
    const int p = order_, i = at[0], j = at[1];
    if (shape == Shape::Line) return {p - i, i, 0, 0};
    if (shape == Shape::Triangle) return {p - i - j, i, j, 0};
    return {(p - i) * (p - j), i * (p - j), i * j, (p - i) * j};
  }

  std::vector<int> make(Shape shape, const std::array<int, 4>& turn) const {
    const auto& lattice = reference::lattice(shape, order_);
    const int vertices = reference::info(shape).vertices;
    std::map<std::array<int, 4>, int> node_at;
    for (std::size_t i = 0; i < lattice.size(); ++i) node_at[weights(shape, lattice[i])] = int(i);
    std::vector<int> map;
    for (const auto& position : lattice) {
      const std::array<int, 4> here = weights(shape, position);
      std::array<int, 4> there{};
      for (int k = 0; k < vertices; ++k) there[std::size_t(turn[std::size_t(k)])] = here[std::size_t(k)];
      const auto at = node_at.find(there);
      if (at == node_at.end()) return {};
      map.push_back(at->second);
    }
    return map;
  }

  int order_;
  std::map<std::pair<Shape, std::array<int, 4>>, std::vector<int>> maps_;
  // Many neighbours in a row correspond in the same way.
  Shape last_shape_ = Shape::Point;
  std::array<int, 4> last_turn_{};
  const std::vector<int>* last_ = nullptr;
};

// A facet with its nodes in the order of one element.
struct FacetNodes {
  Shape shape;
  const std::int32_t* nodes;      ///< The element's nodes.
  const std::vector<int>* local;  ///< The positions of the facet's nodes in `nodes`; null: all nodes, in order.
  std::int32_t node(std::size_t i) const { return nodes[local ? std::size_t((*local)[i]) : i]; }
};

bool agree(const FacetNodes& a, const FacetNodes& b, FacetMaps& maps) {
  if (a.shape != b.shape) return false;
  const auto vertices = std::size_t(reference::info(a.shape).vertices);
  std::array<int, 4> turn{};
  for (std::size_t k = 0; k < vertices; ++k)
    for (std::size_t m = 0; m < vertices; ++m)
      if (a.node(k) == b.node(m)) turn[k] = int(m);
  const std::vector<int>& map = maps.map(a.shape, turn);
  if (map.empty()) return false;
  for (std::size_t i = 0; i < map.size(); ++i)
    if (a.node(i) != b.node(std::size_t(map[i]))) return false;
  return true;
}

std::string describe(const char* what, const FacetNodes& facet, const HighOrderMesh& mesh) {
  std::string text = std::string(what) + " of nodes";
  const int vertices = reference::info(facet.shape).vertices;
  for (int k = 0; k < vertices; ++k)
    text += (k == 0             ? " "
             : k + 1 < vertices ? ", "
                                : " and ") +
            std::to_string(mesh.node_numbers[std::size_t(facet.node(std::size_t(k)))]);
  return text;
}

// The facets of one mesh, by their index in Facets.
class FacetView {
 public:
  FacetView(const HighOrderMesh& mesh, const Facets& facets) : facets_(facets), cells_(mesh, mesh.dimension) {
    for (const Cells::Range& range : cells_.ranges()) {
      const Shape shape = range.block->shape;
      if (!local_[std::size_t(shape)].empty()) continue;
      for (std::size_t f = 0; f < reference::info(shape).facets.size(); ++f)
        local_[std::size_t(shape)].push_back(&reference::facet_nodes(shape, mesh.order, int(f)));
    }
  }

  const Cells& cells() const { return cells_; }
  std::size_t cell_of(std::int32_t facet) const {
    const auto after = std::upper_bound(facets_.first.begin(), facets_.first.end(), facet);
    return std::size_t(after - facets_.first.begin()) - 1;
  }
  FacetNodes nodes(std::size_t cell, std::int32_t facet) const {
    const Cells::Range& range = cells_.range_of(cell);
    const Shape shape = range.block->shape;
    const auto local = std::size_t(facet - facets_.first[cell]);
    return {reference::info(shape).facets[local].shape, range.block->nodes.data() + (cell - range.first) * range.stride,
            local_[std::size_t(shape)][local]};
  }

 private:
  const Facets& facets_;
  Cells cells_;
  // By shape and facet: the local nodes. Looking them up in reference:: takes a lock, for which the threads would wait.
  std::array<std::vector<const std::vector<int>*>, kShapes> local_;
};

constexpr const char* kDisagree =
    ": they have different nodes between the same vertices; write the mesh so that neighbours share them.";

const char* facet_word(const HighOrderMesh& mesh) { return mesh.dimension == 3 ? "face" : "edge"; }

Expected<void> check_crowded(const HighOrderMesh& mesh, const Facets& facets, const FacetView& view) {
  if (facets.crowded < 0) return {};
  const std::size_t cell = view.cell_of(facets.crowded);
  return bad_input("Element " + std::to_string(view.cells().number(cell)) + " and at least two others share the " +
                   describe(facet_word(mesh), view.nodes(cell, facets.crowded), mesh) + " (" +
                   std::to_string(facets.crowded_count) +
                   " such in all), but a facet can have at most two cells; look for overlapping or duplicate parts.");
}

// The element that disagrees with a cell on its facet f: the cell on the other side, or else the boundary element; −1
// if none does. A pair of cells is compared at the facet with the smaller index.
std::int64_t disagreeing(const FacetView& view, const Facets& facets, const Cells& borders, FacetMaps& maps,
                         std::size_t cell, std::int32_t f, std::int32_t border) {
  const std::int32_t opposite = facets.opposite[std::size_t(f)];
  if (opposite < f && border < 0) return -1;
  const FacetNodes here = view.nodes(cell, f);
  if (opposite > f) {
    const auto neighbour = std::size_t(facets.neighbour[std::size_t(f)]);
    if (!agree(here, view.nodes(neighbour, opposite), maps)) return view.cells().number(neighbour);
  }
  if (border < 0) return -1;
  const FacetNodes element{borders.shape(std::size_t(border)), borders.nodes(std::size_t(border)).data(), nullptr};
  return agree(here, element, maps) ? -1 : borders.number(std::size_t(border));
}

Expected<void> check_shared_facets(const HighOrderMesh& mesh, const Facets& facets, const FacetView& view,
                                   const Team& team) {
  struct Fault {
    std::size_t cell = 0;
    std::int32_t facet = -1;
    std::int64_t other = -1;
  };
  const Cells borders(mesh, mesh.dimension - 1);
  const std::size_t cells = view.cells().count();
  std::vector<Fault> faults(chunks_of(cells, kCellsPerTask));  // the first of each chunk
  for_chunks(team, cells, kCellsPerTask, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    FacetMaps maps(mesh.order);
    auto next = std::lower_bound(facets.elements.begin(), facets.elements.end(), std::pair(facets.first[begin], 0));
    for (std::size_t cell = begin; cell < end; ++cell)
      for (std::int32_t f = facets.first[cell]; f < facets.first[cell + 1]; ++f) {
        while (next != facets.elements.end() && next->first < f) ++next;
        const std::int32_t border = next != facets.elements.end() && next->first == f ? next->second : -1;
        const std::int64_t other = disagreeing(view, facets, borders, maps, cell, f, border);
        if (other < 0) continue;
        faults[chunk] = {cell, f, other};
        return;
      }
  });
  for (const Fault& fault : faults)
    if (fault.facet >= 0)
      return bad_input("Elements " + std::to_string(view.cells().number(fault.cell)) + " and " +
                       std::to_string(fault.other) + " disagree on the " +
                       describe(facet_word(mesh), view.nodes(fault.cell, fault.facet), mesh) + kDisagree);
  return {};
}

// === The boundary ========================================================================================
// Two kinds of faults concern only the facets that have one cell: cells that share an edge but no face, and faces with
// four vertices that lie on faces with three.

struct BoundaryEdge {
  std::array<std::int32_t, 2> vertices;
  std::int32_t facet;
  std::int32_t edge;
};

std::array<std::int32_t, 3> sorted_triple(std::int32_t a, std::int32_t b, std::int32_t c) {
  std::array<std::int32_t, 3> triple{a, b, c};
  std::sort(triple.begin(), triple.end());
  return triple;
}

Expected<void> check_hanging_faces(const HighOrderMesh& mesh, const std::vector<std::int32_t>& boundary,
                                   const FacetView& view) {
  std::vector<std::pair<std::array<std::int32_t, 3>, std::size_t>> triangles;
  for (std::int32_t f : boundary) {
    const std::size_t cell = view.cell_of(f);
    const FacetNodes facet = view.nodes(cell, f);
    if (facet.shape == Shape::Triangle)
      triangles.emplace_back(sorted_triple(facet.node(0), facet.node(1), facet.node(2)), cell);
  }
  std::sort(triangles.begin(), triangles.end());
  for (std::int32_t f : boundary) {
    const std::size_t cell = view.cell_of(f);
    const FacetNodes facet = view.nodes(cell, f);
    if (facet.shape != Shape::Quadrilateral) continue;
    for (std::size_t skip = 0; skip < 4; ++skip) {
      const auto key =
          sorted_triple(facet.node((skip + 1) % 4), facet.node((skip + 2) % 4), facet.node((skip + 3) % 4));
      const auto at = std::lower_bound(triangles.begin(), triangles.end(), std::pair(key, std::size_t(0)));
      if (at != triangles.end() && at->first == key)
        return bad_input("Elements " + std::to_string(view.cells().number(cell)) + " and " +
                         std::to_string(view.cells().number(at->second)) +
                         " do not conform: a triangular face of the second lies on the quadrilateral " +
                         describe("face", facet, mesh) + " of the first; put pyramids between them.");
    }
  }
  return {};
}

// The nodes of an edge of a face, from the vertex with the smaller index to the other. A face lists its vertices, and
// then order − 1 nodes for each edge.
std::vector<std::int32_t> edge_nodes(const FacetNodes& face, std::int32_t edge, int order) {
  const std::int32_t vertices = reference::info(face.shape).vertices;
  std::vector<std::int32_t> nodes;
  for (int k = 0; k < order - 1; ++k) nodes.push_back(face.node(std::size_t(vertices + edge * (order - 1) + k)));
  if (face.node(std::size_t(edge)) > face.node(std::size_t((edge + 1) % vertices)))
    std::reverse(nodes.begin(), nodes.end());
  return nodes;
}

Expected<void> check_boundary_edges(const HighOrderMesh& mesh, const std::vector<std::int32_t>& boundary,
                                    const FacetView& view, const Team& team) {
  std::vector<BoundaryEdge> edges;
  for (std::int32_t f : boundary) {
    const FacetNodes face = view.nodes(view.cell_of(f), f);
    const std::int32_t vertices = reference::info(face.shape).vertices;
    for (std::int32_t e = 0; e < vertices; ++e) {
      const std::int32_t a = face.node(std::size_t(e)), b = face.node(std::size_t((e + 1) % vertices));
      edges.push_back({{std::min(a, b), std::max(a, b)}, f, e});
    }
  }
  // A face has an edge once, so no two entries are equal.
  sort_distinct(team, edges, [](const BoundaryEdge& a, const BoundaryEdge& b) {
    return std::tie(a.vertices, a.facet, a.edge) < std::tie(b.vertices, b.facet, b.edge);
  });
  const auto disagree = [&](const BoundaryEdge& a, const BoundaryEdge& b) {
    return a.vertices == b.vertices && edge_nodes(view.nodes(view.cell_of(a.facet), a.facet), a.edge, mesh.order) !=
                                           edge_nodes(view.nodes(view.cell_of(b.facet), b.facet), b.edge, mesh.order);
  };
  const std::size_t pairs = edges.empty() ? 0 : edges.size() - 1;
  const std::size_t i =
      first_of(team, pairs, kEdgesPerTask, [&](std::size_t k) { return disagree(edges[k], edges[k + 1]); });
  if (i == pairs) return {};
  return bad_input("Elements " + std::to_string(view.cells().number(view.cell_of(edges[i].facet))) + " and " +
                   std::to_string(view.cells().number(view.cell_of(edges[i + 1].facet))) +
                   " disagree on the edge of nodes " +
                   std::to_string(mesh.node_numbers[std::size_t(edges[i].vertices[0])]) + " and " +
                   std::to_string(mesh.node_numbers[std::size_t(edges[i].vertices[1])]) + kDisagree);
}

// The facets that have one cell, in order.
std::vector<std::int32_t> boundary_facets(const Facets& facets, const Team& team) {
  std::vector<std::vector<std::int32_t>> parts(chunks_of(facets.neighbour.size(), kFacetsPerTask));
  for_chunks(team, facets.neighbour.size(), kFacetsPerTask, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f)
      if (facets.neighbour[f] < 0) parts[chunk].push_back(std::int32_t(f));
  });
  std::vector<std::int32_t> boundary;
  for (const std::vector<std::int32_t>& part : parts) boundary.insert(boundary.end(), part.begin(), part.end());
  return boundary;
}

}  // namespace

Expected<void> check_conformity(const HighOrderMesh& mesh, const Facets& facets, const Team& team) {
  const FacetView view(mesh, facets);
  if (auto done = check_crowded(mesh, facets, view); !done) return done;
  if (auto done = check_shared_facets(mesh, facets, view, team); !done) return done;
  if (mesh.dimension < 3) return {};
  const std::vector<std::int32_t> boundary = boundary_facets(facets, team);
  if (auto done = check_hanging_faces(mesh, boundary, view); !done) return done;
  return check_boundary_edges(mesh, boundary, view, team);
}

}  // namespace varimesh
