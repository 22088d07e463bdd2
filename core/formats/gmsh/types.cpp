// The numbers are from Gmsh's reference manual, "MSH file format", and from its source file GmshDefines.h (MSH_TRI_3
// …).
#include "core/formats/gmsh/types.h"

#include <array>

#include "core/mesh/changes/serendipity_elements.h"
#include "core/reference/serendipity.h"

namespace varimesh::formats {

namespace {

using Orders = std::array<std::uint8_t, kMaxOrder>;  // the number for order 1, 2, …; 0 if there is none

constexpr std::array<Orders, kShapes> kComplete = {{
    {15, 0, 0, 0, 0, 0, 0, 0, 0, 0},                // point
    {1, 8, 26, 27, 28, 62, 63, 64, 65, 66},         // line
    {2, 9, 21, 23, 25, 42, 43, 44, 45, 46},         // triangle
    {3, 10, 36, 37, 38, 47, 48, 49, 50, 51},        // quadrilateral
    {4, 11, 29, 30, 31, 71, 72, 73, 74, 75},        // tetrahedron
    {7, 14, 118, 119, 120, 121, 122, 123, 124, 0},  // pyramid
    {6, 13, 90, 91, 106, 107, 108, 109, 110, 0},    // prism
    {5, 12, 92, 93, 94, 95, 96, 97, 98, 0},         // hexahedron
}};

// Elements with nodes only on vertices and edges. Tetrahedra from order 4 also have some on faces.
constexpr std::array<Orders, kShapes> kIncomplete = {{
    {},
    {},
    {0, 0, 20, 22, 24, 52, 53, 54, 55, 56},
    {0, 16, 39, 40, 41, 57, 58, 59, 60, 61},
    {0, 0, 137, 32, 33, 79, 80, 81, 82, 83},
    {0, 19, 125, 126, 127, 128, 129, 130, 131, 0},
    {0, 18, 111, 112, 113, 114, 115, 116, 117, 0},
    {0, 17, 99, 100, 101, 102, 103, 104, 105, 0},
}};

constexpr int kTypes = 256;

constexpr std::array<GmshType, kTypes> make_table() {
  std::array<GmshType, kTypes> table{};
  for (int s = 0; s < kShapes; ++s)
    for (int p = 1; p <= kMaxOrder; ++p) {
      if (const int n = kComplete[s][p - 1]) table[n] = {GmshType::Kind::Complete, Shape(s), p};
      if (const int n = kIncomplete[s][p - 1]) table[n] = {GmshType::Kind::Incomplete, Shape(s), p};
    }
  return table;
}

constexpr std::array<GmshType, kTypes> kTable = make_table();

}  // namespace

GmshType gmsh_type(int number) { return number >= 0 && number < kTypes ? kTable[std::size_t(number)] : GmshType{}; }

int gmsh_type_number(Shape shape, int order) {
  return order >= 1 && order <= kMaxOrder ? kComplete[std::size_t(shape)][std::size_t(order - 1)] : 0;
}

int gmsh_type_number(const ElementBlock& block) {
  if (!is_serendipity(block)) return gmsh_type_number(block.shape, block.order);
  return kIncomplete[std::size_t(block.shape)][std::size_t(block.order - 1)];
}

int node_count(const GmshType& type) {
  if (type.kind == GmshType::Kind::Complete) return reference::node_count(type.shape, type.order);
  return type.kind == GmshType::Kind::Incomplete ? reference::serendipity_node_count(type.shape, type.order) : 0;
}

std::string why_refused(int number) {
  const GmshType type = gmsh_type(number);
  if (type.kind == GmshType::Kind::Incomplete)
    return "element type " + std::to_string(number) + " is an incomplete (serendipity) " +
           std::string(reference::info(type.shape).name) + " of order " + std::to_string(type.order) +
           ", whose functions Gmsh does not define so that neighbours fit together; write complete elements, in Gmsh "
           "with Mesh.SecondOrderIncomplete=0";
  return "element type " + std::to_string(number) +
         " is not known; use points, lines, triangles, quadrilaterals, tetrahedra, pyramids, prisms and hexahedra of "
         "order 1 to 10 (pyramids, prisms and hexahedra: 1 to 9)";
}

}  // namespace varimesh::formats
