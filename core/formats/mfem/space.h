// The finite element spaces in which MFEM stores the nodes of a mesh, and the matrices between their degrees of freedom
// and VariMesh's equispaced nodes. Internal to core/formats.
#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>

#include "core/base/error.h"
#include "core/reference/nodes.h"

namespace varimesh::formats {

/// A finite element space for the nodes of a mesh.
struct MfemSpace {
  /// What the degrees of freedom of a cell are: values at points, or coefficients of Bernstein polynomials. The points
  /// of a line on [0, 1], i = 0 … p, are the following. MFEM's documentation of BasisType has the names.
  enum class Basis : std::uint8_t {
    GaussLobatto,     ///< Gauss–Lobatto points.
    ClosedUniform,    ///< i / p.
    Positive,         ///< Bernstein coefficients.
    GaussLegendre,    ///< Gauss–Legendre points.
    OpenUniform,      ///< (i + 1) / (p + 2).
    OpenHalfUniform,  ///< (i + 1/2) / (p + 1).
  };
  Basis basis = Basis::GaussLobatto;
  bool continuous = true;  ///< H1, whose cells share degrees of freedom; otherwise L2, whose cells have their own.
  int order = 1;
  std::string name;  ///< The name of the FiniteElementCollection.
};

/// The space that a collection's name stands for: H1_, H1Pos_, H1@, L2_, L2_T, Linear, Quadratic, QuadraticPos and
/// Cubic. Errors: BadInput for any other name.
Expected<MfemSpace> mfem_space(std::string_view name);

/// The space that VariMesh writes if nothing else is known: H1 on Gauss–Lobatto points.
MfemSpace default_mfem_space(int dimension, int order);

/// Why the space cannot hold cells of this shape, and what to do; empty if it can.
std::string why_not_in_space(const MfemSpace& space, Shape shape);

/// The number of degrees of freedom of a cell that it shares with no other cell. In a pyramid of order p, MFEM's
/// continuous space has (p − 1)³ (Fuentes and others, Computers and Mathematics with Applications 70, 2015); VariMesh's
/// has fewer.
int mfem_interior_count(const MfemSpace& space, Shape shape);

/// The number of nodes inside a cell: those on no vertex, edge or face.
int inner_node_count(Shape shape, int order);

/// The matrices of one shape in one space. `inner`: the degrees of freedom of the cell that no vertex, edge or face
/// has; for a discontinuous space all. In a continuous space MFEM orders them row by row (NodeOrder::Rows) inside the
/// cell, in a discontinuous space the same over the whole cell. Entries that differ from 0 or 1 by rounding only are
/// exact.
struct MfemConversion {
  /// inner × nodes: the inner degrees of freedom from all nodes of the cell, in Gmsh's order.
  Eigen::MatrixXd to_file;
  /// inner nodes × degrees of freedom: the inner nodes, in Gmsh's order, from the degrees of freedom. A column per node
  /// on vertices, edges and faces, in Gmsh's order, and then one per inner degree of freedom.
  Eigen::MatrixXd to_nodes;
  /// For pyramids of a continuous space: what is left of the inner degrees of freedom when the pyramid of VariMesh's
  /// space is taken away; zero if the file's pyramid is in that space. Same columns as to_nodes. Otherwise empty.
  Eigen::MatrixXd left;
};
const MfemConversion& mfem_conversion(const MfemSpace& space, Shape shape);

}  // namespace varimesh::formats
