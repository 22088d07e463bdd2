// Node sets: the uniform lattice, and the optimised nodes that the solver uses.
//
// The optimised nodes are those of J. S. Hesthaven, T. Warburton, Nodal Discontinuous Galerkin Methods, Springer, 2008,
// sections 6.1 and 10.1. They are computed in barycentric coordinates, so that they are symmetric and the same on every
// face.
#include "core/reference/nodes.h"

#include <cassert>
#include <cmath>
#include <map>

#include "core/reference/cache.h"
#include "core/reference/quadrature.h"

namespace varimesh::reference {
namespace {

/// The blending parameter α that minimises the Lebesgue constant, for orders 1 … 15. T. Warburton, An explicit
/// construction of interpolation nodes on the simplex, J. Eng. Math. 56, 2006; Hesthaven and Warburton 2008, tables 6.1
/// and 10.1.
constexpr std::array<double, 15> kTriangleAlpha{0.0,    0.0,    1.4152, 0.1001, 0.2751, 0.9800, 1.0999, 1.2832,
                                                1.3648, 1.4773, 1.4959, 1.5743, 1.5770, 1.6223, 1.6258};
constexpr std::array<double, 15> kTetrahedronAlpha{0.0,    0.0,     0.0,    0.1002, 1.1332, 1.5608, 1.3413, 1.2577,
                                                   1.1603, 1.10153, 0.6080, 0.4523, 0.8856, 0.8717, 0.9655};

/// The order + 1 Gauss–Lobatto–Legendre points, ascending: the ends and the roots of P'_order.
Eigen::VectorXd gauss_lobatto(int order) {
  Eigen::VectorXd points(order + 1);
  points[0] = -1;
  points[order] = 1;
  if (order > 1) points.segment(1, order - 1) = gauss_jacobi(order - 1, 1, 1).first;
  return points;
}

/// The distance from a node at r on a uniform edge to its Gauss–Lobatto node, interpolated to any r in (−1, 1) and
/// divided by 1 − r².
class Warp {
 public:
  explicit Warp(int order) : order_(order), moved_(gauss_lobatto(order)) {
    for (int i = 0; i <= order; ++i) moved_[i] -= uniform(i);
  }

  double operator()(double r) const {
    if (std::abs(r) > 1 - 1e-10) return 0;
    double sum = 0;
    for (int i = 1; i < order_; ++i) {
      // The interpolant is zero at both ends. Each basis function leaves out the factor 1 − r² instead of dividing by
      // it.
      double basis = moved_[i] / (1 - uniform(i) * uniform(i));
      for (int j = 1; j < order_; ++j)
        if (j != i) basis *= (r - uniform(j)) / (uniform(i) - uniform(j));
      sum += basis;
    }
    return sum;
  }

 private:
  double uniform(int i) const { return -1 + 2.0 * i / order_; }

  int order_;
  Eigen::VectorXd moved_;
};

/// The displacement of a point of a triangle, in barycentric coordinates: the warp of each edge along this edge,
/// blended into the triangle (Hesthaven and Warburton 2008, equations 6.8 to 6.11).
Eigen::Vector3d triangle_shift(const Warp& warp, double alpha, const Eigen::Vector3d& at) {
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  for (int opposite = 0; opposite < 3; ++opposite) {
    const int from = (opposite + 1) % 3, to = (opposite + 2) % 3;
    const double blend = 4 * at[from] * at[to] * (1 + std::pow(alpha * at[opposite], 2));
    const double along = blend * warp(at[to] - at[from]);
    shift[to] += along / 2;
    shift[from] -= along / 2;
  }
  return shift;
}

/// The displacement of a point strictly inside a tetrahedron, in barycentric coordinates: the displacement of each
/// face, blended along the coordinate that is zero on it (Hesthaven and Warburton 2008, section 10.1).
Eigen::Vector4d tetrahedron_shift(const Warp& warp, double alpha, const Eigen::Vector4d& at) {
  constexpr std::array<std::array<int, 3>, 4> others{{{1, 2, 3}, {0, 2, 3}, {0, 1, 3}, {0, 1, 2}}};
  Eigen::Vector4d shift = Eigen::Vector4d::Zero();
  for (int opposite = 0; opposite < 4; ++opposite) {
    Eigen::Vector3d face;
    double blend = 1 + std::pow(alpha * at[opposite], 2);
    for (int c = 0; c < 3; ++c) {
      face[c] = at[others[opposite][c]];
      blend *= face[c] / (face[c] + at[opposite] / 2);
    }
    const Eigen::Vector3d in_face = triangle_shift(warp, alpha, face);
    for (int c = 0; c < 3; ++c) shift[others[opposite][c]] += blend * in_face[c];
  }
  return shift;
}

double uniform(int i, int order) { return -1 + 2.0 * i / order; }

/// The mean of the vertices with the given weights, whose sum is 1: converts barycentric to reference coordinates.
template <class Weights>
Eigen::RowVectorXd mean_of_vertices(Shape shape, const Weights& weights) {
  const ShapeInfo& cell = info(shape);
  Eigen::RowVectorXd point = Eigen::RowVectorXd::Zero(cell.dimension);
  for (int v = 0; v < weights.size(); ++v)
    for (int c = 0; c < cell.dimension; ++c) point[c] += weights[v] * cell.vertex[v][c];
  return point;
}

Points equispaced(Shape shape, int order) {
  const int dimension = info(shape).dimension;
  Points points(node_count(shape, order), dimension);
  for (int n = 0; n < points.rows(); ++n) {
    const auto& at = lattice(shape, order)[n];
    // A pyramid's layer at height k spans |x|, |y| ≤ 1 − k / order.
    const double inset = shape == Shape::Pyramid ? static_cast<double>(at[2]) / order : 0.0;
    for (int c = 0; c < dimension; ++c) points(n, c) = uniform(at[c], order) + (c < 2 ? inset : 0.0);
  }
  return points;
}

Points optimised_line(int order) {
  const Eigen::VectorXd along = gauss_lobatto(order);
  Points points(order + 1, 1);
  for (int n = 0; n <= order; ++n) points(n, 0) = along[lattice(Shape::Line, order)[n][0]];
  return points;
}

Points optimised_triangle(int order, double alpha) {
  const Warp warp(order);
  Points points(node_count(Shape::Triangle, order), 2);
  for (int n = 0; n < points.rows(); ++n) {
    const auto& at = lattice(Shape::Triangle, order)[n];
    Eigen::Vector3d weights(order - at[0] - at[1], at[0], at[1]);
    weights /= order;
    weights += triangle_shift(warp, alpha, weights);
    points.row(n) = mean_of_vertices(Shape::Triangle, weights);
  }
  return points;
}

/// The displacement of any lattice point of a tetrahedron, in barycentric coordinates. On a face it is the triangle's.
Eigen::Vector4d tetrahedron_shift_anywhere(const Warp& warp, double alpha, const Eigen::Vector4d& at) {
  for (int opposite = 0; opposite < 4; ++opposite) {
    if (at[opposite] != 0) continue;
    Eigen::Vector3d face;
    for (int c = 0, k = 0; k < 4; ++k)
      if (k != opposite) face[c++] = at[k];
    const Eigen::Vector3d in_face = triangle_shift(warp, alpha, face);
    Eigen::Vector4d shift = Eigen::Vector4d::Zero();
    for (int c = 0, k = 0; k < 4; ++k)
      if (k != opposite) shift[k] = in_face[c++];
    return shift;
  }
  return tetrahedron_shift(warp, alpha, at);
}

Points optimised_tetrahedron(int order) {
  const Warp warp(order);
  const double alpha = kTetrahedronAlpha[order - 1];
  Points points(node_count(Shape::Tetrahedron, order), 3);
  for (int n = 0; n < points.rows(); ++n) {
    const auto& at = lattice(Shape::Tetrahedron, order)[n];
    Eigen::Vector4d weights(order - at[0] - at[1] - at[2], at[0], at[1], at[2]);
    weights /= order;
    weights += tetrahedron_shift_anywhere(warp, alpha, weights);
    points.row(n) = mean_of_vertices(Shape::Tetrahedron, weights);
  }
  return points;
}

/// Gauss–Lobatto–Legendre in every direction of a quadrilateral or hexahedron.
Points optimised_tensor(Shape shape, int order) {
  const Eigen::VectorXd along = gauss_lobatto(order);
  Points points(node_count(shape, order), info(shape).dimension);
  for (int n = 0; n < points.rows(); ++n)
    for (int c = 0; c < points.cols(); ++c) points(n, c) = along[lattice(shape, order)[n][c]];
  return points;
}

/// The triangle's nodes (with the tetrahedron's α) times Gauss–Lobatto–Legendre.
Points optimised_prism(int order) {
  const Eigen::VectorXd along = gauss_lobatto(order);
  const Points& triangle = nodes(Shape::Triangle, order, NodeSet::Optimised, 3);
  std::map<std::array<std::int8_t, 2>, int> number;
  for (int n = 0; n < triangle.rows(); ++n) {
    const auto& at = lattice(Shape::Triangle, order)[n];
    number[{at[0], at[1]}] = n;
  }
  Points points(node_count(Shape::Prism, order), 3);
  for (int n = 0; n < points.rows(); ++n) {
    const auto& at = lattice(Shape::Prism, order)[n];
    points.row(n) << triangle.row(number.at({at[0], at[1]})), along[at[2]];
  }
  return points;
}

/// Takes the positions of facet nodes from the nodes of the facets themselves, so that neighbours share them.
void place_facet_nodes(Shape shape, int order, Points& points) {
  const ShapeInfo& cell = info(shape);
  for (std::size_t f = 0; f < cell.facets.size(); ++f) {
    const Facet& facet = cell.facets[f];
    const Points& own = nodes(facet.shape, order, NodeSet::Optimised, 3);
    const std::vector<int>& number = facet_nodes(shape, order, static_cast<int>(f));
    for (int n = 0; n < own.rows(); ++n) {
      const double s = (1 + own(n, 0)) / 2, t = (1 + own(n, 1)) / 2;
      Eigen::VectorXd weights = Eigen::VectorXd::Zero(cell.vertices);
      if (facet.shape == Shape::Triangle) {
        for (int v = 0; v < 3; ++v) weights[facet.vertices[v]] = std::array{1 - s - t, s, t}[v];
      } else {
        for (int v = 0; v < 4; ++v)
          weights[facet.vertices[v]] = std::array{(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t}[v];
      }
      points.row(number[n]) = mean_of_vertices(shape, weights);
    }
  }
}

/// The nodes of the faces are those of the neighbours. Inside, every layer of the lattice is a square grid that shrinks
/// towards the apex. Its nodes get the displacement of the layer's outline by transfinite interpolation (W. J. Gordon,
/// C. A. Hall, Numer. Math. 21, 1973). On the base this gives the Gauss–Lobatto grid, so the layers join the base
/// smoothly. The displacement in the middle of a layer is reduced in proportion to the height, because the middle is
/// farthest from all four triangles. This reduces the Lebesgue constant at order 10 by a fifth, from 63 to 49; a
/// biharmonic extension gives 45.
Points optimised_pyramid(int order) {
  const Points uniform_nodes = equispaced(Shape::Pyramid, order);
  Points points = uniform_nodes;
  place_facet_nodes(Shape::Pyramid, order, points);
  std::map<std::array<std::int8_t, 3>, int> number;
  const auto& positions = lattice(Shape::Pyramid, order);
  for (int n = 0; n < points.rows(); ++n) number[positions[n]] = n;
  for (int n = 0; n < points.rows(); ++n) {
    if (node_places(Shape::Pyramid, order)[n].dimension < 3) continue;
    const auto [i, j, k] = positions[n];
    const int last = order - k;
    const auto shift = [&, k = k](int a, int b) -> Eigen::RowVector3d {
      const int m = number.at({static_cast<std::int8_t>(a), static_cast<std::int8_t>(b), k});
      return points.row(m) - uniform_nodes.row(m);
    };
    const double s = static_cast<double>(i) / last, t = static_cast<double>(j) / last;
    const Eigen::RowVector3d outline = (1 - s) * shift(0, j) + s * shift(last, j) + (1 - t) * shift(i, 0) +
                                       t * shift(i, last) - (1 - s) * (1 - t) * shift(0, 0) -
                                       s * (1 - t) * shift(last, 0) - (1 - s) * t * shift(0, last) -
                                       s * t * shift(last, last);
    const double middle = 16 * s * (1 - s) * t * (1 - t), height = static_cast<double>(k) / order;
    points.row(n) += (1 - middle * height) * outline;
  }
  return points;
}

Points optimised(Shape shape, int order, int ambient) {
  switch (shape) {
    case Shape::Point:
      return Points(1, 0);
    case Shape::Line:
      return optimised_line(order);
    case Shape::Triangle:
      return optimised_triangle(order, (ambient == 3 ? kTetrahedronAlpha : kTriangleAlpha)[order - 1]);
    case Shape::Quadrilateral:
    case Shape::Hexahedron:
      return optimised_tensor(shape, order);
    case Shape::Tetrahedron:
      return optimised_tetrahedron(order);
    case Shape::Pyramid:
      return optimised_pyramid(order);
    case Shape::Prism:
      return optimised_prism(order);
  }
  assert(false && "a shape that is not in the table");
  return {};
}

}  // namespace

const Points& nodes(Shape shape, int order, NodeSet set, int ambient) {
  assert(order >= 1 && order <= kMaxOrder);
  assert(ambient == 2 || ambient == 3);
  static Cache<std::array<int, 4>, Points> cache;
  // Only triangles depend on the ambient dimension, and only their optimised nodes.
  const bool depends = shape == Shape::Triangle && set == NodeSet::Optimised;
  return cache.get({static_cast<int>(shape), order, static_cast<int>(set), depends ? ambient : 3}, [&] {
    return set == NodeSet::Equispaced ? equispaced(shape, order) : optimised(shape, order, ambient);
  });
}

}  // namespace varimesh::reference
