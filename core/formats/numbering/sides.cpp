#include "core/formats/numbering/sides.h"

#include <algorithm>
#include <cassert>
#include <string_view>
#include <vector>

namespace varimesh::formats {

namespace {

using reference::Facet;

/// One row of the table: the vertices of each edge and of each face, with blanks between them.
struct Row {
  Sides format;
  Shape shape;
  std::string_view edges, faces;
};

constexpr std::array kTable = {
    // Geometry::Constants in MFEM's documentation of its classes.
    Row{Sides::Mfem, Shape::Line, "01", ""},
    Row{Sides::Mfem, Shape::Triangle, "01 12 20", "012"},
    Row{Sides::Mfem, Shape::Quadrilateral, "01 12 23 30", "0123"},
    Row{Sides::Mfem, Shape::Tetrahedron, "01 02 03 12 13 23", "123 032 013 021"},
    Row{Sides::Mfem, Shape::Pyramid, "01 12 32 03 04 14 24 34", "3210 014 124 234 304"},
    Row{Sides::Mfem, Shape::Prism, "01 12 20 34 45 53 03 14 25", "021 345 0143 1254 2035"},
    Row{Sides::Mfem, Shape::Hexahedron, "01 12 32 03 45 56 76 47 04 15 26 37", "3210 0154 1265 2376 3047 4567"},

    // CGNS SIDS, "Unstructured Grid Element Numbering Conventions", from LINE_3 to HEXA_125.
    Row{Sides::CgnsNodes, Shape::Line, "01", ""},
    Row{Sides::CgnsNodes, Shape::Triangle, "01 12 20", ""},
    Row{Sides::CgnsNodes, Shape::Quadrilateral, "01 12 23 30", ""},
    Row{Sides::CgnsNodes, Shape::Tetrahedron, "01 12 20 03 13 23", "012 013 123 203"},
    Row{Sides::CgnsNodes, Shape::Pyramid, "01 12 23 30 04 14 24 34", "0123 014 124 234 304"},
    Row{Sides::CgnsNodes, Shape::Prism, "01 12 20 03 14 25 34 45 53", "012 0143 1254 2035 345"},
    Row{Sides::CgnsNodes, Shape::Hexahedron, "01 12 23 30 04 15 26 37 45 56 67 74", "0123 0154 1265 2376 3047 4567"},

    // The same conventions, TRI_3, QUAD_4, TETRA_4, PYRA_5, PENTA_6 and HEXA_8.
    Row{Sides::Cgns, Shape::Triangle, "", "01 12 20"},
    Row{Sides::Cgns, Shape::Quadrilateral, "", "01 12 23 30"},
    Row{Sides::Cgns, Shape::Tetrahedron, "", "021 013 123 203"},
    Row{Sides::Cgns, Shape::Pyramid, "", "0321 014 124 234 304"},
    Row{Sides::Cgns, Shape::Prism, "", "0143 1254 2035 021 345"},
    Row{Sides::Cgns, Shape::Hexahedron, "", "0321 0154 1265 2376 0473 4567"},

    // Nektar++ user guide, "Geometry". The prism's faces 0 1 2 3, 0 1 4, 1 2 5 4, 3 2 5 and 0 3 5 4 there have the
    // vertices of kNektarPrism.
    Row{Sides::Nektar, Shape::Tetrahedron, "", "012 013 123 023"},
    Row{Sides::Nektar, Shape::Pyramid, "", "0123 014 124 324 034"},
    Row{Sides::Nektar, Shape::Prism, "", "0253 021 2541 354 0341"},
    Row{Sides::Nektar, Shape::Hexahedron, "", "0123 0154 1265 3267 0374 4567"},

    // PyFR's numbering of faces (faces of its shapes).
    Row{Sides::Pyfr, Shape::Triangle, "", "01 12 02"},
    Row{Sides::Pyfr, Shape::Quadrilateral, "", "01 12 23 03"},
    Row{Sides::Pyfr, Shape::Tetrahedron, "", "012 013 023 123"},
    Row{Sides::Pyfr, Shape::Pyramid, "", "0123 014 124 234 034"},
    Row{Sides::Pyfr, Shape::Prism, "", "012 345 0134 1245 0235"},
    Row{Sides::Pyfr, Shape::Hexahedron, "", "0123 0145 1256 2367 0347 4567"},

    // HOHQMesh's documentation, "The ISM mesh file formats".
    Row{Sides::Ism, Shape::Quadrilateral, "", "01 12 32 03"},
    Row{Sides::Ism, Shape::Hexahedron, "", "0154 3267 0123 1265 4567 0374"},

    // "Exodus: A Finite Element Data Model", SAND92-2137, node and side set numbering of the elements.
    Row{Sides::Exodus, Shape::Line, "01", ""},
    Row{Sides::Exodus, Shape::Triangle, "01 12 20", "01 12 20"},
    Row{Sides::Exodus, Shape::Quadrilateral, "01 12 23 30", "01 12 23 30"},
    Row{Sides::Exodus, Shape::Tetrahedron, "01 12 20 03 13 23", "013 123 032 021"},
    Row{Sides::Exodus, Shape::Pyramid, "01 12 23 30 04 14 24 34", "014 124 234 304 0321"},
    Row{Sides::Exodus, Shape::Prism, "01 12 20 03 14 25 34 45 53", "0143 1254 0352 021 345"},
    Row{Sides::Exodus, Shape::Hexahedron, "01 12 23 30 04 15 26 37 45 56 67 74", "0154 1265 2376 0473 0321 4567"},

    // Abaqus' manual, "Three-dimensional solid element library" and "Two-dimensional solid element library".
    Row{Sides::Abaqus, Shape::Line, "01", ""},
    Row{Sides::Abaqus, Shape::Triangle, "01 12 20", "01 12 20"},
    Row{Sides::Abaqus, Shape::Quadrilateral, "01 12 23 30", "01 12 23 30"},
    Row{Sides::Abaqus, Shape::Tetrahedron, "01 12 20 03 13 23", "021 013 123 032"},
    Row{Sides::Abaqus, Shape::Pyramid, "01 12 23 30 04 14 24 34", "0321 014 124 234 304"},
    Row{Sides::Abaqus, Shape::Prism, "01 12 20 34 45 53 03 14 25", "021 345 0143 1254 2035"},
    Row{Sides::Abaqus, Shape::Hexahedron, "01 12 23 30 45 56 67 74 04 15 26 37", "0321 4567 0154 1265 2376 0473"},
};

constexpr std::size_t kFormats = std::size_t(Sides::Abaqus) + 1;

/// Calls body(vertices) for each word of a row.
template <class Body>
void for_words(std::string_view words, const Body& body) {
  while (!words.empty()) {
    std::array<std::int8_t, 4> vertices{-1, -1, -1, -1};
    const std::size_t count = std::min(words.find(' '), words.size());
    for (std::size_t v = 0; v < count; ++v) vertices[v] = std::int8_t(words[v] - '0');
    body(vertices);
    words.remove_prefix(std::min(count + 1, words.size()));
  }
}

struct Lists {
  std::vector<std::array<std::int8_t, 2>> edges;
  std::vector<Facet> faces;
};

const Lists& lists(Sides format, Shape shape) {
  static const auto all = [] {
    std::array<std::array<Lists, kShapes>, kFormats> made;
    for (const Row& row : kTable) {
      Lists& own = made[std::size_t(row.format)][std::size_t(row.shape)];
      for_words(row.edges, [&](const auto& v) { own.edges.push_back({v[0], v[1]}); });
      for_words(row.faces, [&](const auto& v) {
        own.faces.push_back({v[2] < 0 ? Shape::Line : v[3] < 0 ? Shape::Triangle : Shape::Quadrilateral, v});
      });
    }
    return made;
  }();
  return all[std::size_t(format)][std::size_t(shape)];
}

std::array<std::int8_t, 4> sorted(std::array<std::int8_t, 4> vertices) {
  std::sort(vertices.begin(), vertices.end());
  return vertices;
}

}  // namespace

std::span<const std::array<std::int8_t, 2>> edges_of(Sides format, Shape shape) { return lists(format, shape).edges; }

std::span<const Facet> faces_of(Sides format, Shape shape) { return lists(format, shape).faces; }

std::array<std::int8_t, 6> same_sides(std::span<const Facet> sides, std::span<const Facet> as) {
  std::array<std::int8_t, 6> same{};
  for (std::size_t s = 0; s < sides.size(); ++s) {
    std::size_t other = 0;
    while (other < as.size() && sorted(as[other].vertices) != sorted(sides[s].vertices)) ++other;
    assert(other < as.size());
    same[s] = std::int8_t(other);
  }
  return same;
}

std::span<const CgnsSide> cgns_sides(Shape shape) {
  static const auto all = [] {
    std::array<std::vector<CgnsSide>, kShapes> made;
    for (int s = 0; s < kShapes; ++s) {
      const auto sides = faces_of(Sides::Cgns, Shape(s));
      const auto facets = same_sides(sides, reference::info(Shape(s)).facets);
      for (std::size_t k = 0; k < sides.size(); ++k)
        made[std::size_t(s)].push_back({corners_of(sides[k]), sides[k].vertices, facets[k]});
    }
    return made;
  }();
  return all[std::size_t(shape)];
}

}  // namespace varimesh::formats
