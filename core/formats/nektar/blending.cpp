#include "core/formats/nektar/blending.h"

#include <Eigen/LU>
#include <array>
#include <cassert>
#include <vector>

#include "core/reference/cache.h"
#include "core/reference/nodes.h"

namespace varimesh::formats {

namespace {

using Values = std::vector<double>;

/// tⁿ P_n^(a,b)(x / t): a Jacobi polynomial as a homogeneous polynomial of x and t.
double jacobi(int n, double a, double b, double x, double t) {
  double before = 0, now = 1;
  for (int k = 0; k < n; ++k) {
    const double s = 2 * k + a + b;
    double next = 0;
    if (k == 0) {
      next = ((a - b) * t + (a + b + 2) * x) / 2;
    } else {
      const double up = 2 * (k + 1) * (k + a + b + 1) * s;
      next = (((s + 1) * (a * a - b * b) * t + s * (s + 1) * (s + 2) * x) * now -
              2 * (k + a) * (k + b) * (s + 2) * t * t * before) /
             up;
    }
    before = now;
    now = next;
  }
  return now;
}

/// The functions of a line, at the point with these barycentric coordinates: two vertices, then the inner ones.
Values line(double first, double second, int order) {
  Values values{first, second};
  for (int p = 2; p <= order; ++p)
    values.push_back(first * second * jacobi(p - 2, 1, 1, second - first, first + second));
  return values;
}

/// The functions of the vertices, edges and faces of a simplex, at the point with these barycentric coordinates. Each
/// edge and face is a product of factors that rise with its second and third vertex; a factor is a polynomial of the
/// vertex's coordinate and of the sum of those before.
struct Simplex {
  Values vertices_and_edges, faces;
};

Simplex simplex(std::span<const double> at, int order) {
  Simplex made;
  made.vertices_and_edges.assign(at.begin(), at.end());
  std::array<double, 5> below{};  // sums of the coordinates before each vertex
  for (std::size_t v = 0; v < at.size(); ++v) below[v + 1] = below[v] + at[v];
  const auto factor = [&](std::size_t v, int n, double a) {
    return at[v] * jacobi(n, a, 1, at[v] - below[v], below[v + 1]);
  };
  for (std::size_t b = 1; b < at.size(); ++b)
    for (std::size_t a = 0; a < b; ++a)
      for (int p = 2; p <= order; ++p) {
        const double edge = at[a] * factor(b, p - 2, 1);
        made.vertices_and_edges.push_back(edge);
        for (std::size_t c = b + 1; c < at.size(); ++c)
          for (int q = 1; p + q <= order; ++q) made.faces.push_back(edge * factor(c, q - 1, 2 * p - 1));
      }
  return made;
}

/// The functions of the boundary of a cell at a node, and which of them VariMesh's cell does not have.
struct Modes {
  Values values;
  std::vector<bool> outside;

  void add(double value, bool is_outside = false) {
    values.push_back(value);
    outside.push_back(is_outside);
  }
};

/// Adds the products of functions; `inner`: from which function on each list has functions of the interior. Products of
/// only these are left out.
void add_products(Modes& modes, std::span<const Values> factors, std::span<const std::size_t> inner, double product = 1,
                  bool all_inner = true) {
  if (factors.empty()) {
    if (!all_inner) modes.add(product);
    return;
  }
  for (std::size_t i = 0; i < factors[0].size(); ++i)
    add_products(modes, factors.subspan(1), inner.subspan(1), product * factors[0][i], all_inner && i >= inner[0]);
}

void add_pyramid(Modes& modes, const std::array<std::int8_t, 3>& node, int order) {
  const double shrink = double(order - node[2]) / order, up = double(node[2]) / order;
  const auto direction = [&](std::int8_t position) {
    const double x = node[2] == order ? 0 : double(position) / (order - node[2]);
    return line(1 - x, x, order);
  };
  const Values first = direction(node[0]), second = direction(node[1]);
  // What rises from the base: a power that makes the product a polynomial, and above the base a polynomial too.
  const auto power = [&](int n) { return std::pow(shrink, n); };
  modes.add(up);
  for (int p = 0; p <= order; ++p)
    for (int q = 0; q <= order; ++q) {
      const double base = first[std::size_t(p)] * second[std::size_t(q)];
      const int n = p > 1 && q > 1 ? p + q - 2 : std::max({p, q, 1});
      modes.add(base * power(n), n > order);
      if (p > 1 && q > 1) continue;  // the rest is the interior
      for (int r = 1; n + r <= order; ++r)
        modes.add(base * power(n) * up * jacobi(r - 1, 2 * n - 1, 1, up - shrink, 1));
    }
}

Modes modes_at(Shape shape, const std::array<std::int8_t, 3>& node, int order) {
  Modes modes;
  const auto part = [&](int steps) { return double(steps) / order; };
  const auto direction = [&](std::size_t k) { return line(part(order - node[k]), part(node[k]), order); };
  constexpr std::array<std::size_t, 3> kInner = {2, 2, 2};
  switch (shape) {
    case Shape::Triangle: {
      const std::array at = {part(order - node[0] - node[1]), part(node[0]), part(node[1])};
      for (const double value : simplex(at, order).vertices_and_edges) modes.add(value);
      break;
    }
    case Shape::Quadrilateral: {
      const std::array factors = {direction(0), direction(1)};
      add_products(modes, factors, kInner);
      break;
    }
    case Shape::Tetrahedron: {
      const std::array at = {part(order - node[0] - node[1] - node[2]), part(node[0]), part(node[1]), part(node[2])};
      const Simplex values = simplex(at, order);
      for (const double value : values.vertices_and_edges) modes.add(value);
      for (const double value : values.faces) modes.add(value);
      break;
    }
    case Shape::Pyramid:
      add_pyramid(modes, node, order);
      break;
    case Shape::Prism: {
      // Collapsed towards vertices 1 and 4: the first direction of the lattice is Nektar++'s second.
      const std::array at = {part(order - node[0] - node[1]), part(node[1]), part(node[0])};
      Simplex triangle = simplex(at, order);
      const std::array inner = {triangle.vertices_and_edges.size(), std::size_t(2)};
      Values& all = triangle.vertices_and_edges;
      all.insert(all.end(), triangle.faces.begin(), triangle.faces.end());
      const std::array factors = {all, direction(2)};
      add_products(modes, factors, inner);
      break;
    }
    case Shape::Hexahedron: {
      const std::array factors = {direction(0), direction(1), direction(2)};
      add_products(modes, factors, kInner);
      break;
    }
    default:
      assert(!"points and lines have no blended interior");
  }
  return modes;
}

NektarBlending make_blending(Shape shape, int order) {
  const auto& lattice = reference::lattice(shape, order);
  const auto& places = reference::node_places(shape, order);
  const int dimension = reference::info(shape).dimension;
  Eigen::Index boundary = 0;
  while (boundary < Eigen::Index(places.size()) && places[std::size_t(boundary)].dimension < dimension) ++boundary;
  Eigen::MatrixXd values(Eigen::Index(lattice.size()), boundary);
  std::vector<bool> outside;
  for (std::size_t i = 0; i < lattice.size(); ++i) {
    const Modes modes = modes_at(shape, lattice[i], order);
    assert(Eigen::Index(modes.values.size()) == boundary);
    values.row(Eigen::Index(i)) = Eigen::Map<const Eigen::RowVectorXd>(modes.values.data(), boundary);
    outside = modes.outside;
  }
  NektarBlending made;
  const Eigen::MatrixXd coefficients = values.topRows(boundary).partialPivLu().inverse();
  made.inside = values.bottomRows(values.rows() - boundary) * coefficients;
  made.outside.resize(std::count(outside.begin(), outside.end(), true), boundary);
  Eigen::Index row = 0;
  for (Eigen::Index mode = 0; mode < boundary; ++mode)
    if (outside[std::size_t(mode)]) made.outside.row(row++) = coefficients.row(mode);
  return made;
}

}  // namespace

const NektarBlending& nektar_blending(Shape shape, int order) {
  static reference::Cache<std::array<int, 2>, NektarBlending> cache;
  return cache.get({int(shape), order}, [&] { return make_blending(shape, order); });
}

}  // namespace varimesh::formats
