// Two elements that share a facet must have the same nodes there, each at the same position of the facet's lattice.
#include "core/mesh/conformity.h"

#include <algorithm>
#include <array>
#include <map>

#include "core/reference/nodes.h"

namespace varimesh {

namespace {

// How the nodes of a facet as one cell orders them correspond to those as the other cell orders them, for each way in
// which the vertices can correspond. A lattice node is identified by its weights at the vertices: barycentric on lines
// and triangles, bilinear on quadrilaterals.
class FacetMaps {
 public:
  explicit FacetMaps(int order) : order_(order) {}

  /// The number in the second order of each node of the first order, if vertex k of the first order is vertex turn[k]
  /// of the second. Empty if `turn` is not a symmetry of the shape.
  const std::vector<int>& map(Shape shape, const std::array<int, 4>& turn) {
    auto [at, is_new] = maps_.try_emplace({shape, turn});
    if (is_new) at->second = make(shape, turn);
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
  FacetView(const HighOrderMesh& mesh, const Facets& facets)
      : mesh_(mesh), facets_(facets), cells_(mesh, mesh.dimension) {}

  const Cells& cells() const { return cells_; }
  std::size_t cell_of(std::int32_t facet) const {
    const auto after = std::upper_bound(facets_.first.begin(), facets_.first.end(), facet);
    return std::size_t(after - facets_.first.begin()) - 1;
  }
  FacetNodes nodes(std::size_t cell, std::int32_t facet) const {
    const Cells::Range& range = cells_.range_of(cell);
    const int local = facet - facets_.first[cell];
    return {reference::info(range.block->shape).facets[std::size_t(local)].shape,
            range.block->nodes.data() + (cell - range.first) * range.stride,
            &reference::facet_nodes(range.block->shape, mesh_.order, local)};
  }

 private:
  const HighOrderMesh& mesh_;
  const Facets& facets_;
  Cells cells_;
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

Expected<void> check_shared_facets(const HighOrderMesh& mesh, const Facets& facets, const FacetView& view) {
  FacetMaps maps(mesh.order);
  const Cells borders(mesh, mesh.dimension - 1);
  auto next = facets.elements.begin();
  for (std::size_t cell = 0; cell < view.cells().count(); ++cell)
    for (std::int32_t f = facets.first[cell]; f < facets.first[cell + 1]; ++f) {
      while (next != facets.elements.end() && next->first < f) ++next;
      const std::int32_t border = next != facets.elements.end() && next->first == f ? next->second : -1;
      const std::int32_t opposite = facets.opposite[std::size_t(f)];
      if (opposite < f && border < 0) continue;
      const FacetNodes here = view.nodes(cell, f);
      std::int64_t other = -1;
      if (opposite > f) {
        const auto neighbour = std::size_t(facets.neighbour[std::size_t(f)]);
        if (!agree(here, view.nodes(neighbour, opposite), maps)) other = view.cells().number(neighbour);
      }
      if (border >= 0 && other < 0) {
        const FacetNodes element{borders.shape(std::size_t(border)), borders.nodes(std::size_t(border)).data(),
                                 nullptr};
        if (!agree(here, element, maps)) other = borders.number(std::size_t(border));
      }
      if (other >= 0)
        return bad_input("Elements " + std::to_string(view.cells().number(cell)) + " and " + std::to_string(other) +
                         " disagree on the " + describe(facet_word(mesh), here, mesh) + kDisagree);
    }
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
                                    const FacetView& view) {
  std::vector<BoundaryEdge> edges;
  for (std::int32_t f : boundary) {
    const FacetNodes face = view.nodes(view.cell_of(f), f);
    const std::int32_t vertices = reference::info(face.shape).vertices;
    for (std::int32_t e = 0; e < vertices; ++e) {
      const std::int32_t a = face.node(std::size_t(e)), b = face.node(std::size_t((e + 1) % vertices));
      edges.push_back({{std::min(a, b), std::max(a, b)}, f, e});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const BoundaryEdge& a, const BoundaryEdge& b) {
    return std::tie(a.vertices, a.facet) < std::tie(b.vertices, b.facet);
  });
  for (std::size_t i = 1; i < edges.size(); ++i) {
    if (edges[i].vertices != edges[i - 1].vertices) continue;
    const std::size_t a = view.cell_of(edges[i - 1].facet), b = view.cell_of(edges[i].facet);
    if (edge_nodes(view.nodes(a, edges[i - 1].facet), edges[i - 1].edge, mesh.order) ==
        edge_nodes(view.nodes(b, edges[i].facet), edges[i].edge, mesh.order))
      continue;
    return bad_input("Elements " + std::to_string(view.cells().number(a)) + " and " +
                     std::to_string(view.cells().number(b)) + " disagree on the edge of nodes " +
                     std::to_string(mesh.node_numbers[std::size_t(edges[i].vertices[0])]) + " and " +
                     std::to_string(mesh.node_numbers[std::size_t(edges[i].vertices[1])]) + kDisagree);
  }
  return {};
}

}  // namespace

Expected<void> check_conformity(const HighOrderMesh& mesh, const Facets& facets) {
  const FacetView view(mesh, facets);
  if (auto done = check_crowded(mesh, facets, view); !done) return done;
  if (auto done = check_shared_facets(mesh, facets, view); !done) return done;
  if (mesh.dimension < 3) return {};
  std::vector<std::int32_t> boundary;
  for (std::size_t f = 0; f < facets.neighbour.size(); ++f)
    if (facets.neighbour[f] < 0) boundary.push_back(std::int32_t(f));
  if (auto done = check_hanging_faces(mesh, boundary, view); !done) return done;
  return check_boundary_edges(mesh, boundary, view);
}

}  // namespace varimesh
