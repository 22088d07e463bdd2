// Curves and surfaces that consist of high-order elements: the boundary of a mesh as a geometry. Internal to the
// library.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/geometry/geometry.h"
#include "core/reference/shape.h"

namespace varimesh::geometry {

/// An element of a surface: a triangle or quadrilateral.
struct SurfacePiece {
  Shape shape = Shape::Triangle;
  Eigen::Matrix3Xd x;                 ///< Positions of its equispaced nodes, in Gmsh's order.
  std::vector<std::int32_t> numbers;  ///< By node: pieces with equal numbers share the node.
};

/// How far the pieces lie from the smooth shape that they interpolate, as far as this can be seen from themselves.
struct InterpolationError {
  double largest = 0;
  double rms = 0;
};

/// A curve of elements that follow one another.
struct PieceCurve {
  std::shared_ptr<const CurveShape> shape;
  InterpolationError error;
  std::vector<double> t;  ///< The parameters at which the pieces begin, and that at which the last one ends.
};

/// A surface of elements, of which neighbours meet smoothly.
struct PieceSurface {
  std::shared_ptr<const SurfaceShape> shape;
  InterpolationError error;
};

/// Makes a curve of elements of one order, each of which begins where the one before ends. The parameter t runs over a
/// piece by the length of its chord. A closed curve has a period. Where pieces meet, the derivatives may jump.
/// @param pieces  positions of the equispaced nodes of each line, in Gmsh's order
PieceCurve curve_of_pieces(const std::vector<Eigen::Matrix3Xd>& pieces, bool closed);

/// Makes a surface of elements of one order. The parameters of piece k are u = 4 k + ξ and v = η with the reference
/// coordinates (ξ, η) of the element; parameters between two pieces belong to the polynomials of the nearer one, but
/// not to the surface. All pieces must be numbered in the same sense.
PieceSurface surface_of_pieces(std::vector<SurfacePiece> pieces, int order);

/// The parameters (u, v) of a node of a piece.
std::array<double, 2> parameters_of_node(const SurfacePiece& piece, std::size_t number_of_piece, int order,
                                         std::size_t node);

}  // namespace varimesh::geometry
