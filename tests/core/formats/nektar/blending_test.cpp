// The interior that Nektar++ gives to cells: the functions of its boundary, in collapsed coordinates, as its
// documentation writes them.
#include "core/formats/nektar/blending.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <functional>

#include "core/reference/nodes.h"

namespace varimesh {
namespace {

/// P_n^(a,b)(z), by its explicit sum.
double jacobi(int n, int a, int b, double z) {
  const auto choose = [](int top, int k) {
    double value = 1;
    for (int i = 0; i < k; ++i) value *= double(top - i) / (i + 1);
    return value;
  };
  double sum = 0;
  for (int s = 0; s <= n; ++s)
    sum += choose(n + a, n - s) * choose(n + b, s) * std::pow((z - 1) / 2, s) * std::pow((z + 1) / 2, n - s);
  return sum;
}

// The modified principal functions of Karniadakis and Sherwin, section 3.2. Index 1 of the second and third stands for
// what is (1 + z)/2 at index 0, 1.
double first(int p, double z) {
  if (p < 2) return p == 0 ? (1 - z) / 2 : (1 + z) / 2;
  return (1 - z) / 2 * (1 + z) / 2 * jacobi(p - 2, 1, 1, z);
}
double second(int p, int q, double z) {
  if (p == 0) return first(q, z);
  if (q == 0) return std::pow((1 - z) / 2, p);
  return std::pow((1 - z) / 2, p) * (1 + z) / 2 * jacobi(q - 1, 2 * p - 1, 1, z);
}
double third(int p, int q, int r, double z) { return second(p + q, r, z); }

/// A function of the boundary at a position of the lattice in [0, 1]³.
using Mode = std::function<double(double, double, double)>;

double collapsed(double x, double rest) { return rest > 0 ? 2 * x / rest - 1 : -1; }

std::vector<Mode> triangle(int order, bool with_interior = false) {
  std::vector<Mode> modes;
  for (int p = 0; p <= order; ++p)
    for (int q = 0; p + q <= order; ++q) {
      if (p == 0 && q == 1) {  // the vertex to which all collapses
        modes.emplace_back([](double, double y, double) { return y; });
        continue;
      }
      if (p >= 2 && q >= 1 && !with_interior) continue;
      modes.emplace_back(
          [=](double x, double y, double) { return first(p, collapsed(x, 1 - y)) * second(p, q, 2 * y - 1); });
    }
  return modes;
}

std::vector<Mode> tetrahedron(int order) {
  std::vector<Mode> modes;
  for (int p = 0; p <= order; ++p)
    for (int q = 0; p + q <= order; ++q)
      for (int r = 0; p + q + r <= order; ++r) {
        const bool inside = p >= 2 && q >= 1 && r >= 1;
        if (inside) continue;
        modes.emplace_back([=](double x, double y, double z) {
          const double a = collapsed(x, 1 - y - z), b = collapsed(y, 1 - z), c = 2 * z - 1;
          if (p == 0 && q == 0 && r == 1) return z;                          // the top
          if (p == 0 && q == 1) return second(0, 1, b) * third(0, 1, r, c);  // the edge above vertex 2
          return first(p, a) * second(p, q, b) * third(p, q, r, c);
        });
      }
  return modes;
}

std::vector<Mode> prism(int order) {
  std::vector<Mode> modes;
  const std::vector<Mode> boundary = triangle(order), all = triangle(order, true);
  // Gmsh's prism collapses in its first direction: Nektar++'s first direction is Gmsh's second.
  for (int k = 0; k <= order; ++k)
    for (const Mode& flat : k < 2 ? all : boundary)
      modes.emplace_back([=](double x, double y, double z) { return flat(y, x, 0) * first(k, 2 * z - 1); });
  return modes;
}

std::vector<Mode> box(int order, int dimension) {
  std::vector<Mode> modes;
  for (int i = 0; i <= order; ++i)
    for (int j = 0; j <= order; ++j)
      for (int k = 0; k <= (dimension == 3 ? order : 0); ++k)
        if (i < 2 || j < 2 || (dimension == 3 && k < 2))
          modes.emplace_back([=](double x, double y, double z) {
            return first(i, 2 * x - 1) * first(j, 2 * y - 1) * (dimension == 3 ? first(k, 2 * z - 1) : 1);
          });
  return modes;
}

/// Above the base, p and q of 2 and more are the interior. Those of the base fit into VariMesh's cell up to
/// p + q − 2 = order.
std::vector<Mode> pyramid(int order, bool that_fit) {
  std::vector<Mode> modes;
  if (that_fit) modes.emplace_back([](double, double, double z) { return z; });
  for (int p = 0; p <= order; ++p)
    for (int q = 0; q <= order; ++q) {
      const bool base = p > 1 && q > 1;
      const int n = base ? p + q - 2 : std::max({p, q, 1});
      for (int r = 0; r == 0 || (!base && n + r <= order); ++r) {
        if ((n <= order) != that_fit) continue;
        modes.emplace_back([=](double x, double y, double z) {
          const double a = collapsed(x, 1 - z), b = collapsed(y, 1 - z);
          return z == 1 ? 0 : first(p, a) * first(q, b) * second(n, r, 2 * z - 1);
        });
      }
    }
  return modes;
}

void expect_continued(Shape shape, int order, const std::vector<Mode>& modes, bool fits = true) {
  const formats::NektarBlending& blending = formats::nektar_blending(shape, order);
  const auto& lattice = reference::lattice(shape, order);
  for (std::size_t m = 0; m < modes.size(); ++m) {
    Eigen::VectorXd values(Eigen::Index(lattice.size()));
    for (std::size_t i = 0; i < lattice.size(); ++i)
      values(Eigen::Index(i)) =
          modes[m](double(lattice[i][0]) / order, double(lattice[i][1]) / order, double(lattice[i][2]) / order);
    const Eigen::VectorXd boundary = values.head(blending.inside.cols());
    const Eigen::VectorXd inner = values.tail(blending.inside.rows());
    if (inner.size() > 0) {
      EXPECT_LE((blending.inside * boundary - inner).cwiseAbs().maxCoeff(), 1e-10)
          << reference::info(shape).name << " of order " << order << ", function " << m;
    }
    if (blending.outside.rows() > 0) {
      const double outside = (blending.outside * boundary).cwiseAbs().maxCoeff();
      EXPECT_EQ(outside < 1e-9, fits) << outside;
    }
  }
}

TEST(NektarBlending, ContinuesEveryFunctionOfTheBoundary) {
  for (int order = 1; order <= kMaxOrder; ++order) {
    expect_continued(Shape::Triangle, order, triangle(order));
    expect_continued(Shape::Quadrilateral, order, box(order, 2));
    expect_continued(Shape::Tetrahedron, order, tetrahedron(order));
    expect_continued(Shape::Prism, order, prism(order));
    expect_continued(Shape::Hexahedron, order, box(order, 3));
    expect_continued(Shape::Pyramid, order, pyramid(order, true));
    expect_continued(Shape::Pyramid, order, pyramid(order, false), false);
  }
}

TEST(NektarBlending, OfSquaresIsTransfinite) {
  // The interior of a quadrilateral by Gordon and Hall's formula.
  const int order = 4;
  const auto f = [](double x, double y) { return std::sin(2 * x + 3 * y) + x * x * y; };
  const auto& lattice = reference::lattice(Shape::Quadrilateral, order);
  const formats::NektarBlending& blending = formats::nektar_blending(Shape::Quadrilateral, order);
  Eigen::VectorXd values(Eigen::Index(lattice.size()));
  for (std::size_t i = 0; i < lattice.size(); ++i)
    values(Eigen::Index(i)) = f(double(lattice[i][0]) / order, double(lattice[i][1]) / order);
  const Eigen::VectorXd inner = blending.inside * values.head(blending.inside.cols());
  for (Eigen::Index i = 0; i < inner.size(); ++i) {
    const auto& at = lattice[std::size_t(blending.inside.cols() + i)];
    const double x = double(at[0]) / order, y = double(at[1]) / order;
    const double wanted = (1 - x) * f(0, y) + x * f(1, y) + (1 - y) * f(x, 0) + y * f(x, 1) -
                          (1 - x) * (1 - y) * f(0, 0) - x * (1 - y) * f(1, 0) - (1 - x) * y * f(0, 1) - x * y * f(1, 1);
    EXPECT_NEAR(inner(i), wanted, 1e-13);
  }
}

}  // namespace
}  // namespace varimesh
