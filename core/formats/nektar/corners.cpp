
// Finds the vertices of the edges, faces and cells of a Nektar++ file.
#include <algorithm>

#include "core/formats/nektar/file.h"
#include "core/formats/nektar/nektar.h"
#include "core/formats/scanner.h"

namespace varimesh::formats {

namespace {

using Vertices = std::array<std::int32_t, 8>;

class Finder {
 public:
  Finder(NektarFile& file, FileAllowance& allowance) : file_(file), allowance_(allowance) {}

  NektarCorners take() {
    resolve_edges();
    find_vertices();
    return std::move(made_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { Scanner(file_.bytes).fail(what); }

  void resolve_edges() {
    for (std::size_t e = 0; e < file_.edge_ids.size(); ++e) {
      for (std::size_t k = 0; k < 2; ++k) {
        const std::int32_t vertex = file_.vertex_ids.find(file_.edges[2 * e + k]);
        if (vertex < 0)
          fail("edge " + std::to_string(file_.edge_ids[e]) + " refers to vertex " +
               std::to_string(file_.edges[2 * e + k]) + ", which is not in the file");
        file_.edges[2 * e + k] = vertex;
      }
      if (file_.edges[2 * e] == file_.edges[2 * e + 1])
        fail("edge " + std::to_string(file_.edge_ids[e]) + " has the same vertex twice");
    }
  }

  /// The vertices of a face from its edges: vertex k is common to edge k and the edge before.
  Vertices around(const std::string& name, std::span<const std::int32_t> edges) const {
    std::array<std::array<std::int64_t, 2>, 4> ends{};
    for (std::size_t k = 0; k < edges.size(); ++k) {
      const std::int32_t edge = file_.edge_ids.find(edges[k]);
      if (edge < 0) fail(name + " refers to edge " + std::to_string(edges[k]) + ", which is not in the file");
      ends[k] = {file_.edges[2 * std::size_t(edge)], file_.edges[2 * std::size_t(edge) + 1]};
    }
    Vertices vertices{};
    for (std::size_t k = 0; k < edges.size(); ++k) {
      const auto& before = ends[(k + edges.size() - 1) % edges.size()];
      const bool first = ends[k][0] == before[0] || ends[k][0] == before[1];
      const bool second = ends[k][1] == before[0] || ends[k][1] == before[1];
      if (first == second) fail("the edges of " + name + " do not go around it");
      vertices[k] = std::int32_t(ends[k][first ? 0 : 1]);
    }
    for (std::size_t k = 0; k < edges.size(); ++k)
      if (std::count(vertices.begin(), vertices.begin() + std::ptrdiff_t(edges.size()), vertices[k]) > 1)
        fail("the edges of " + name + " do not go around it");
    return vertices;
  }

  /// The vertices of a cell from its faces: each vertex is the one that lies on the faces on which it should lie.
  Vertices of_cell(const std::string& name, Shape shape, std::span<const std::int32_t> sides) const {
    const std::span<const reference::Facet> faces = nektar_faces(shape);
    std::array<unsigned, 8> wanted{};
    std::vector<std::pair<std::int32_t, unsigned>> found;  // a vertex, and the faces on which it lies
    for (std::size_t f = 0; f < sides.size(); ++f) {
      const std::int32_t face = file_.faces.ids.find(sides[f]);
      if (face < 0) fail(name + " refers to face " + std::to_string(sides[f]) + ", which is not in the file");
      if (file_.faces.shapes[std::size_t(face)] != faces[f].shape)
        fail("face " + std::to_string(f) + " of " + name + " has the wrong shape");
      for (std::size_t k = 0; k < std::size_t(reference::info(faces[f].shape).vertices); ++k) {
        wanted[std::size_t(faces[f].vertices[k])] |= 1U << f;
        const std::int32_t vertex = made_.faces[std::size_t(face)][k];
        const auto known =
            std::find_if(found.begin(), found.end(), [&](const auto& one) { return one.first == vertex; });
        if (known != found.end())
          known->second |= 1U << f;
        else
          found.emplace_back(vertex, 1U << f);
      }
    }
    Vertices vertices{};
    const auto count = std::size_t(reference::info(shape).vertices);
    for (std::size_t v = 0; v < count; ++v) {
      const auto one =
          std::find_if(found.begin(), found.end(), [&](const auto& each) { return each.second == wanted[v]; });
      if (one == found.end() || found.size() != count) fail("the faces of " + name + " do not enclose it");
      vertices[v] = one->first;
    }
    return vertices;
  }

  void find_vertices() {
    allowance_.take(file_.faces.ids.size(), sizeof(std::array<std::int32_t, 4>));
    const std::int32_t* sides = file_.faces.sides.data();
    for (std::size_t f = 0; f < file_.faces.ids.size(); ++f) {
      const auto count = std::size_t(nektar_sides(file_.faces.shapes[f]));
      const Vertices own = around("face " + std::to_string(file_.faces.ids[f]), {sides, count});
      made_.faces.push_back({own[0], own[1], own[2], own[3]});
      sides += count;
    }
    free_memory(file_.faces.sides);
    sides = file_.elements.sides.data();
    for (std::size_t e = 0; e < file_.elements.ids.size(); ++e) {
      const Shape shape = file_.elements.shapes[e];
      const std::span own(sides, std::size_t(nektar_sides(shape)));
      const std::string name = "element " + std::to_string(file_.elements.ids[e]);
      const Vertices vertices = file_.dimension == 2 ? around(name, own) : of_cell(name, shape, own);
      const auto count = std::ptrdiff_t(reference::info(shape).vertices);
      allowance_.take(std::size_t(count), sizeof(std::int32_t));
      made_.cells.insert(made_.cells.end(), vertices.begin(), vertices.begin() + count);
      sides += own.size();
    }
    free_memory(file_.elements.sides);
  }

  NektarFile& file_;
  FileAllowance& allowance_;
  NektarCorners made_;
};

}  // namespace

std::span<const reference::Facet> nektar_faces(Shape shape) {
  constexpr auto kT = Shape::Triangle, kQ = Shape::Quadrilateral;
  static constexpr std::array<reference::Facet, 4> kTetrahedron = {
      {{kT, {0, 1, 2, -1}}, {kT, {0, 1, 3, -1}}, {kT, {1, 2, 3, -1}}, {kT, {0, 2, 3, -1}}}};
  static constexpr std::array<reference::Facet, 5> kPyramid = {
      {{kQ, {0, 1, 2, 3}}, {kT, {0, 1, 4, -1}}, {kT, {1, 2, 4, -1}}, {kT, {3, 2, 4, -1}}, {kT, {0, 3, 4, -1}}}};
  // Faces 0 1 2 3, 0 1 4, 1 2 5 4, 3 2 5 and 0 3 5 4 of Nektar++.
  static constexpr std::array<reference::Facet, 5> kPrism = {
      {{kQ, {0, 2, 5, 3}}, {kT, {0, 2, 1, -1}}, {kQ, {2, 5, 4, 1}}, {kT, {3, 5, 4, -1}}, {kQ, {0, 3, 4, 1}}}};
  static constexpr std::array<reference::Facet, 6> kHexahedron = {{{kQ, {0, 1, 2, 3}},
                                                                   {kQ, {0, 1, 5, 4}},
                                                                   {kQ, {1, 2, 6, 5}},
                                                                   {kQ, {3, 2, 6, 7}},
                                                                   {kQ, {0, 3, 7, 4}},
                                                                   {kQ, {4, 5, 6, 7}}}};
  switch (shape) {
    case Shape::Tetrahedron:
      return kTetrahedron;
    case Shape::Pyramid:
      return kPyramid;
    case Shape::Prism:
      return kPrism;
    case Shape::Hexahedron:
      return kHexahedron;
    default:
      return {};
  }
}

NektarCorners nektar_corners(NektarFile& file, FileAllowance& allowance) { return Finder(file, allowance).take(); }

}  // namespace varimesh::formats
