// Lagrange bases. Lines, triangles, tetrahedra and pyramids use their modal basis, with a Vandermonde matrix that is
// factored once. The bases of the other shapes are products of these. Their modal bases would give the same with far
// more work: a hexahedron of order 10 has 1331 nodes.
#include "core/reference/basis.h"

#include <Eigen/LU>
#include <cassert>
#include <map>
#include <utility>

#include "core/reference/cache.h"
#include "core/reference/modal.h"

namespace varimesh::reference {
namespace {

/// The shapes whose product the cell is. Their lattice directions follow one another.
std::vector<Shape> factors(Shape shape) {
  switch (shape) {
    case Shape::Quadrilateral:
      return {Shape::Line, Shape::Line};
    case Shape::Prism:
      return {Shape::Triangle, Shape::Line};
    case Shape::Hexahedron:
      return {Shape::Line, Shape::Line, Shape::Line};
    default:
      return {shape};
  }
}

/// For each factor, the number of the factor's node that belongs to each node of the product cell.
using FactorNodes = std::vector<std::vector<int>>;

const FactorNodes& factor_nodes(Shape shape, int order) {
  static Cache<std::pair<Shape, int>, FactorNodes> cache;
  return cache.get({shape, order}, [&] {
    FactorNodes numbers;
    int direction = 0;
    for (const Shape factor : factors(shape)) {
      const int dimension = info(factor).dimension;
      const auto restricted = [&](const std::array<std::int8_t, 3>& position, int from) {
        std::array<std::int8_t, 3> part{};
        for (int c = 0; c < dimension; ++c) part[c] = position[from + c];
        return part;
      };
      std::map<std::array<std::int8_t, 3>, int> number;
      for (const auto& position : lattice(factor, order)) number.try_emplace(position, static_cast<int>(number.size()));
      std::vector<int> of_nodes;
      for (const auto& position : lattice(shape, order)) of_nodes.push_back(number.at(restricted(position, direction)));
      numbers.push_back(of_nodes);
      direction += dimension;
    }
    return numbers;
  });
}

using Factorisation = Eigen::PartialPivLU<Eigen::MatrixXd>;

/// The factored transposed Vandermonde matrix of a node set, modes × nodes.
const Factorisation& vandermonde(Shape shape, int order, NodeSet set, int ambient) {
  static Cache<std::array<int, 4>, Factorisation> cache;
  return cache.get({static_cast<int>(shape), order, static_cast<int>(set), ambient}, [&] {
    return Factorisation(modal_values(shape, order, nodes(shape, order, set, ambient)).transpose());
  });
}

/// Converts modal values or derivatives at points, points × modes, to those of the Lagrange basis, points × nodes.
Eigen::MatrixXd to_lagrange(Shape shape, int order, NodeSet set, int ambient, const Eigen::MatrixXd& modal) {
  return vandermonde(shape, order, set, ambient).solve(modal.transpose()).transpose();
}

/// A prism is always in 3-D, so its triangles use the tetrahedron's α whatever the caller asks for.
int ambient_of(Shape shape, int ambient) { return info(shape).dimension == 3 ? 3 : ambient; }

}  // namespace

// === BasisAtPoints =======================================================================================

BasisAtPoints::BasisAtPoints(Shape shape, int order, NodeSet set, int ambient, Points at)
    : shape_(shape), order_(order), set_(set), ambient_(ambient_of(shape, ambient)), points_(std::move(at)) {
  assert(points_.cols() == info(shape).dimension);
  if (factors(shape).size() > 1) factors_ = evaluate_factors(shape, order, set, ambient_, points_);
}

std::vector<BasisAtPoints::FactorBasis> BasisAtPoints::evaluate_factors(Shape shape, int order, NodeSet set,
                                                                        int ambient, const Points& at) {
  std::vector<FactorBasis> bases;
  int direction = 0;
  for (const Shape factor : factors(shape)) {
    const int dimension = info(factor).dimension;
    const Points part = at.middleCols(direction, dimension);
    FactorBasis basis;
    basis.values = to_lagrange(factor, order, set, ambient, modal_values(factor, order, part));
    for (const Eigen::MatrixXd& modal : modal_gradients(factor, order, part))
      basis.gradients.push_back(to_lagrange(factor, order, set, ambient, modal));
    bases.push_back(std::move(basis));
    direction += dimension;
  }
  return bases;
}

/// Multiplies one matrix per factor.
Eigen::MatrixXd BasisAtPoints::multiply(const std::vector<const Eigen::MatrixXd*>& of_factors, Eigen::Index first,
                                        Eigen::Index count) const {
  const FactorNodes& numbers = factor_nodes(shape_, order_);
  Eigen::MatrixXd product(count, node_count(shape_, order_));
  for (Eigen::Index n = 0; n < product.cols(); ++n) {
    product.col(n) = of_factors[0]->col(numbers[0][n]).segment(first, count);
    for (std::size_t f = 1; f < of_factors.size(); ++f)
      product.col(n).array() *= of_factors[f]->col(numbers[f][n]).segment(first, count).array();
  }
  return product;
}

Eigen::MatrixXd BasisAtPoints::values(Eigen::Index first, Eigen::Index count) const {
  if (shape_ == Shape::Point) return Eigen::MatrixXd::Ones(count, 1);
  if (factors_.empty())
    return to_lagrange(shape_, order_, set_, ambient_, modal_values(shape_, order_, points_.middleRows(first, count)));
  std::vector<const Eigen::MatrixXd*> of_factors;
  for (const FactorBasis& basis : factors_) of_factors.push_back(&basis.values);
  return multiply(of_factors, first, count);
}

std::vector<Eigen::MatrixXd> BasisAtPoints::gradients(Eigen::Index first, Eigen::Index count) const {
  std::vector<Eigen::MatrixXd> gradients;
  if (shape_ == Shape::Point) return gradients;
  if (factors_.empty()) {
    for (const Eigen::MatrixXd& modal : modal_gradients(shape_, order_, points_.middleRows(first, count)))
      gradients.push_back(to_lagrange(shape_, order_, set_, ambient_, modal));
    return gradients;
  }
  for (std::size_t differentiated = 0; differentiated < factors_.size(); ++differentiated) {
    std::vector<const Eigen::MatrixXd*> of_factors;
    for (const FactorBasis& basis : factors_) of_factors.push_back(&basis.values);
    for (const Eigen::MatrixXd& gradient : factors_[differentiated].gradients) {
      of_factors[differentiated] = &gradient;
      gradients.push_back(multiply(of_factors, first, count));
    }
  }
  return gradients;
}

// === All points at once ==================================================================================

Eigen::MatrixXd basis_values(Shape shape, int order, NodeSet set, int ambient, const Points& at) {
  return BasisAtPoints(shape, order, set, ambient, at).values(0, at.rows());
}

std::vector<Eigen::MatrixXd> basis_gradients(Shape shape, int order, NodeSet set, int ambient, const Points& at) {
  return BasisAtPoints(shape, order, set, ambient, at).gradients(0, at.rows());
}

const Eigen::MatrixXd& conversion(Shape shape, int order, NodeSet from, NodeSet to, int ambient) {
  static Cache<std::array<int, 5>, Eigen::MatrixXd> cache;
  const std::array<int, 5> key{static_cast<int>(shape), order, static_cast<int>(from), static_cast<int>(to), ambient};
  return cache.get(key, [&]() -> Eigen::MatrixXd {
    const int count = node_count(shape, order);
    if (from == to) return Eigen::MatrixXd::Identity(count, count);
    return basis_values(shape, order, from, ambient, nodes(shape, order, to, ambient));
  });
}

Points uniform_lattice(Shape shape, int intervals) {
  assert(intervals >= 1);
  const int dimension = info(shape).dimension, n = intervals;
  const auto steps = [&](int direction) { return direction < dimension ? n : 0; };
  const bool simplex = shape == Shape::Triangle || shape == Shape::Tetrahedron;
  std::vector<std::array<double, 3>> points;
  for (int k = 0; k <= steps(2); ++k) {
    if (shape == Shape::Pyramid && k == n) break;
    // How many steps the higher directions leave for this one.
    const int layer = shape == Shape::Pyramid || shape == Shape::Tetrahedron ? n - k : steps(1);
    for (int j = 0; j <= layer; ++j) {
      int row = shape == Shape::Pyramid ? layer : steps(0);
      if (simplex || shape == Shape::Prism) row = (shape == Shape::Tetrahedron ? layer : n) - j;
      const double inset = shape == Shape::Pyramid ? static_cast<double>(k) / n : 0.0;
      for (int i = 0; i <= row; ++i)
        points.push_back({-1 + 2.0 * i / n + inset, -1 + 2.0 * j / n + inset, -1 + 2.0 * k / n});
    }
  }
  if (shape == Shape::Pyramid) {
    // The gradient at the apex depends on the direction of approach: here along the axis and along the four edges.
    constexpr double kStep = 1e-6, kHalfWidth = kStep / 2;
    points.push_back({0, 0, 1 - kStep});
    for (int v = 0; v < 4; ++v)
      points.push_back({kHalfWidth * info(shape).vertex[v][0], kHalfWidth * info(shape).vertex[v][1], 1 - kStep});
  }
  Points matrix(points.size(), dimension);
  for (std::size_t p = 0; p < points.size(); ++p)
    for (int c = 0; c < dimension; ++c) matrix(p, c) = points[p][c];
  return matrix;
}

}  // namespace varimesh::reference
