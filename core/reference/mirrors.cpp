#include "core/reference/mirrors.h"

#include <cassert>

namespace varimesh::reference {

Mirrors mirrors(Shape shape) {
  const ShapeInfo& cell = info(shape);
  const int d = cell.dimension;
  assert(d == 2 || d == 3);
  const auto vertex = [&](int v) -> Eigen::VectorXd {
    return Eigen::Map<const Eigen::Vector3d>(cell.vertex[v].data()).head(d);
  };
  Mirrors out{d, Eigen::VectorXd::Zero(d), Eigen::MatrixXd::Identity(d, d)};
  // On a simplex, no mirror reverses the direction from the middle of the first edge to the opposite vertex or edge.
  const Eigen::VectorXd middle = (vertex(0) + vertex(1)) / 2;
  switch (shape) {
    case Shape::Triangle:
      out.count = 1;
      out.origin = (2 * middle + vertex(2)) / 3;
      out.directions.row(0) = (vertex(1) - vertex(0)) / 2;
      out.directions.row(1) = (vertex(2) - middle) / 2;
      break;
    case Shape::Tetrahedron: {
      const Eigen::VectorXd opposite = (vertex(2) + vertex(3)) / 2;
      out.count = 2;
      out.origin = (middle + opposite) / 2;
      out.directions.row(0) = (vertex(1) - vertex(0)) / 2;
      out.directions.row(1) = (vertex(3) - vertex(2)) / 2;
      out.directions.row(2) = (opposite - middle) / 2;
      break;
    }
    case Shape::Prism:
      out.count = 2;
      out.origin.head(2) = ((2 * middle + vertex(2)) / 3).head(2);
      out.directions.row(0) = (vertex(1) - vertex(0)) / 2;
      out.directions.row(1) = (vertex(3) - vertex(0)) / 2;
      out.directions.row(2) = (vertex(2) - middle) / 2;
      break;
    case Shape::Pyramid:
      out.count = 2;
      break;
    default:
      break;  // a square or a cube: every coordinate is a mirror
  }
  return out;
}

}  // namespace varimesh::reference
