// The table of node orders: in which order each format lists the nodes of a cell. Internal to core/formats.
#pragma once

#include <array>
#include <span>
#include <string_view>
#include <vector>

#include "core/reference/shape.h"

namespace varimesh::formats {

/// A position (i, j, k) on the lattice of a cell, as reference::lattice() has it.
using Position = std::array<int, 3>;
using Positions = std::vector<Position>;

/// The orders in which file formats list the nodes of a cell. VariMesh's meshes have Gmsh's order.
enum class NodeOrder : std::uint8_t {
  Gmsh,    ///< Vertices, edges, faces, interior; faces and interior ordered recursively in the same way.
  Vtk,     ///< VTK's Lagrange cells, in files below version 2.1.
  Mfem,    ///< The degrees of freedom of MFEM's continuous elements: vertices, edges, faces row by row, interior.
  Rows,    ///< Row by row: i fastest, then j, then k.
  Cgns,    ///< CGNS, up to order 4: vertices, edges, faces, interior; the inside of a quadrilateral is a spiral.
  Nektar,  ///< Curves of Nektar++: triangles by vertices, edges and rows of the interior; other shapes row by row.
  Exodus,  ///< Exodus, order 2: as CGNS, but the inside of hexahedra comes before their faces, which go axis by axis.
  Abaqus,  ///< Abaqus, order 2: the edges of the bottom, of the top and between them; VTK's quadratic cells have it
           ///< too.
};

/// One row of the table.
struct NodeOrderEntry {
  NodeOrder order;
  std::string_view name;
  std::string_view source;  ///< Where the format's authors describe the order.
  /// The lattice position of each node of a cell, in the format's order.
  Positions (*positions)(Shape shape, int order);
};

/// All node orders.
std::span<const NodeOrderEntry> node_orders();

/// The lattice position of each node of a cell, in this order. VTK's order has no pyramids of order 2 and above;
/// vtk_cell() writes them as hexahedra.
const Positions& node_positions(NodeOrder node_order, Shape shape, int order);

/// For each node of the format's order, the number of the same node in Gmsh's order. Not for VTK's pyramids of order 2
/// and above.
const std::vector<int>& gmsh_nodes(NodeOrder node_order, Shape shape, int order);

/// Gmsh's local number of the node at each position of the lattice; −1 if the lattice has no node there. The position
/// (i, j, k) has the index i + (order + 1) (j + (order + 1) k).
const std::vector<int>& nodes_by_position(Shape shape, int order);

/// The positions strictly between two positions that are `order` steps apart.
void add_edge(Positions& list, const Position& from, const Position& to, int order);

/// The positions strictly inside a face, row by row: the first direction goes from `origin` to `first`, the second from
/// `origin` to `second`. A triangle's rows become shorter.
void add_face_rows(Positions& list, const Position& origin, const Position& first, const Position& second, int order,
                   bool triangle);

/// The order of VTK, in vtk_order.cpp. For pyramids of order 2 and above these are positions in the hexahedron.
Positions vtk_positions(Shape shape, int order);

/// Those of Exodus and Abaqus, in quadratic_order.cpp. They have no orders above 2; for them, these are CGNS's.
Positions exodus_positions(Shape shape, int order);
Positions abaqus_positions(Shape shape, int order);

}  // namespace varimesh::formats
