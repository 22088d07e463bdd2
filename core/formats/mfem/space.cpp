// Sources: MFEM's documentation of FiniteElementCollection (names), BasisType (points) and of the elements
// H1_TriangleElement, H1_TetrahedronElement, H1_WedgeElement, H1_FuentesPyramidElement and their L2 counterparts
// (positions of the points).
#include "core/formats/mfem/space.h"

#include <Eigen/LU>
#include <Eigen/QR>
#include <array>
#include <cassert>
#include <charconv>
#include <cmath>
#include <optional>

#include "core/formats/mfem/topology.h"
#include "core/formats/numbering/node_order.h"
#include "core/reference/basis.h"
#include "core/reference/cache.h"
#include "core/reference/quadrature.h"

namespace varimesh::formats {

namespace {

using Basis = MfemSpace::Basis;
using reference::Points;

// === Names ===============================================================================================

/// Reads "2D_P4": a dimension and an order.
std::optional<int> order_of(std::string_view text) {
  if (text.size() < 5 || text.substr(1, 3) != "D_P") return std::nullopt;
  int order = 0;
  const auto [stop, error] = std::from_chars(text.data() + 4, text.data() + text.size(), order);
  if (error != std::errc() || stop != text.data() + text.size()) return std::nullopt;
  return order;
}

struct Prefix {
  std::string_view name;
  Basis basis;
  bool continuous;
};

constexpr std::array kPrefixes{
    Prefix{"H1_", Basis::GaussLobatto, true},        Prefix{"H1@G_", Basis::GaussLobatto, true},
    Prefix{"H1@U_", Basis::ClosedUniform, true},     Prefix{"H1Pos_", Basis::Positive, true},
    Prefix{"H1@P_", Basis::Positive, true},          Prefix{"L2_T0_", Basis::GaussLegendre, false},
    Prefix{"L2_T1_", Basis::GaussLobatto, false},    Prefix{"L2_T2_", Basis::Positive, false},
    Prefix{"L2_T3_", Basis::OpenUniform, false},     Prefix{"L2_T4_", Basis::ClosedUniform, false},
    Prefix{"L2_T5_", Basis::OpenHalfUniform, false}, Prefix{"L2_", Basis::GaussLegendre, false},
};

struct OldName {
  std::string_view name;
  int order;
  Basis basis;
};

constexpr std::array kOldNames{OldName{"Linear", 1, Basis::ClosedUniform},
                               OldName{"Quadratic", 2, Basis::ClosedUniform},
                               OldName{"QuadraticPos", 2, Basis::Positive}, OldName{"Cubic", 3, Basis::ClosedUniform}};

// === Points ==============================================================================================

/// The points of a line on [0, 1].
std::vector<double> line_points(Basis basis, int order) {
  std::vector<double> points;
  const auto on_unit = [&](const Eigen::VectorXd& x) {
    for (const double value : x) points.push_back((1 + value) / 2);
  };
  switch (basis) {
    case Basis::GaussLobatto: {
      // The nodes of a line are its two ends, and then the inner ones from left to right.
      const Points& nodes = reference::nodes(Shape::Line, order, reference::NodeSet::Optimised, 2);
      Eigen::VectorXd x(order + 1);
      x(0) = nodes(0, 0);
      x(order) = nodes(1, 0);
      for (int i = 1; i < order; ++i) x(i) = nodes(i + 1, 0);
      on_unit(x);
      break;
    }
    case Basis::GaussLegendre:
      on_unit(reference::gauss_jacobi(order + 1, 0, 0).first);
      break;
    case Basis::OpenUniform:
      for (int i = 0; i <= order; ++i) points.push_back((i + 1.0) / (order + 2));
      break;
    case Basis::OpenHalfUniform:
      for (int i = 0; i <= order; ++i) points.push_back((i + 0.5) / (order + 1));
      break;
    case Basis::ClosedUniform:
    case Basis::Positive:
      for (int i = 0; i <= order; ++i) points.push_back(double(i) / order);
      break;
  }
  return points;
}

/// The place of a lattice position on the unit cell of MFEM, whose coordinates are from 0 to 1. On simplices a point
/// has the weights of the line's points at i, j, … and at what is left of the order. Pyramids: only on faces.
std::array<double, 3> place(Shape shape, const Position& at, const std::vector<double>& line) {
  const int order = int(line.size()) - 1;
  const auto [i, j, k] = at;
  const auto c = [&](int index) { return line[std::size_t(index)]; };
  switch (shape) {
    case Shape::Triangle:
    case Shape::Prism: {
      const double sum = c(i) + c(j) + c(order - i - j);
      return {c(i) / sum, c(j) / sum, shape == Shape::Prism ? c(k) : 0};
    }
    case Shape::Tetrahedron: {
      const double sum = c(i) + c(j) + c(k) + c(order - i - j - k);
      return {c(i) / sum, c(j) / sum, c(k) / sum};
    }
    case Shape::Pyramid: {
      if (k == 0) return {c(i), c(j), 0};
      const bool across = i == 0 || i + k == order;  // the face runs along j
      const int along = across ? j : i;
      const double sum = c(along) + c(k) + c(order - along - k), z = c(k) / sum, x = c(along) / sum;
      const double other = (across ? i : j) == 0 ? 0 : 1 - z;
      return across ? std::array{other, x, z} : std::array{x, other, z};
    }
    default:
      return {c(i), c(j), c(k)};
  }
}

/// The same point in VariMesh's reference cell.
Eigen::RowVector3d in_reference(Shape shape, const std::array<double, 3>& unit) {
  const auto [x, y, z] = unit;
  if (shape == Shape::Pyramid) return {2 * x - (1 - z), 2 * y - (1 - z), 2 * z - 1};
  return {2 * x - 1, 2 * y - 1, 2 * z - 1};
}

/// Values of VariMesh's basis at points: points × nodes.
Eigen::MatrixXd values_at(Shape shape, int order, const std::vector<std::array<double, 3>>& places) {
  const int d = reference::info(shape).dimension;
  Points points(Eigen::Index(places.size()), d);
  for (std::size_t i = 0; i < places.size(); ++i) points.row(Eigen::Index(i)) = in_reference(shape, places[i]).head(d);
  if (places.empty()) return Eigen::MatrixXd(0, reference::node_count(shape, order));
  return reference::basis_values(shape, order, reference::NodeSet::Equispaced, std::max(d, 2), points);
}

// === Bernstein polynomials ===============================================================================

/// n! / (a! b! c! d!), where a + b + c + d = n.
double multinomial(std::array<int, 4> parts) {
  double value = 1;
  int n = 0;
  for (const int part : parts)
    for (int k = 1; k <= part; ++k) value *= double(++n) / k;
  return value;
}

/// The Bernstein polynomial of a lattice position at a point of the unit cell. Not for pyramids.
double bernstein(Shape shape, int order, const Position& at, const std::array<double, 3>& x) {
  const int i = at[0], j = at[1], k = at[2];
  const auto line = [&](int index, double u) {
    return multinomial({index, order - index, 0, 0}) * std::pow(u, index) * std::pow(1 - u, order - index);
  };
  const auto triangle = [&] {
    const int rest = order - i - j;
    return multinomial({i, j, rest, 0}) * std::pow(x[0], i) * std::pow(x[1], j) * std::pow(1 - x[0] - x[1], rest);
  };
  switch (shape) {
    case Shape::Line:
      return line(i, x[0]);
    case Shape::Triangle:
      return triangle();
    case Shape::Prism:
      return triangle() * line(k, x[2]);
    case Shape::Tetrahedron: {
      const int rest = order - i - j - k;
      return multinomial({i, j, k, rest}) * std::pow(x[0], i) * std::pow(x[1], j) * std::pow(x[2], k) *
             std::pow(1 - x[0] - x[1] - x[2], rest);
    }
    case Shape::Quadrilateral:
      return line(i, x[0]) * line(j, x[1]);
    case Shape::Hexahedron:
      return line(i, x[0]) * line(j, x[1]) * line(k, x[2]);
    case Shape::Point:
    case Shape::Pyramid:
      break;
  }
  assert(!"the space has no such shape");
  return 0;
}

// === Matrices ============================================================================================

/// Removes rounding from entries that are 0 or 1.
Eigen::MatrixXd cleaned(Eigen::MatrixXd matrix) {
  constexpr double kRounding = 1e-13;
  for (double& entry : matrix.reshaped())
    for (const double exact : {0.0, 1.0})
      if (std::abs(entry - exact) < kRounding) entry = exact;
  return matrix;
}

/// The degrees of freedom at these positions, from the nodes of the cell: positions × nodes.
Eigen::MatrixXd dofs_from_nodes(const MfemSpace& space, Shape shape, const Positions& positions) {
  if (space.basis != Basis::Positive) {
    const std::vector<double> line = line_points(space.basis, space.order);
    std::vector<std::array<double, 3>> places;
    places.reserve(positions.size());
    for (const Position& at : positions) places.push_back(place(shape, at, line));
    return values_at(shape, space.order, places);
  }
  // The coefficients are those whose polynomial has the nodes as values.
  const Positions& nodes = node_positions(NodeOrder::Gmsh, shape, space.order);
  const std::vector<double> line = line_points(space.basis, space.order);
  Eigen::MatrixXd values(Eigen::Index(nodes.size()), Eigen::Index(nodes.size()));
  for (Eigen::Index n = 0; n < values.rows(); ++n) {
    std::array<double, 3> x{};
    for (std::size_t c = 0; c < 3; ++c) x[c] = double(nodes[std::size_t(n)][c]) / space.order;
    for (Eigen::Index b = 0; b < values.cols(); ++b)
      values(n, b) = bernstein(shape, space.order, nodes[std::size_t(b)], x);
  }
  const Eigen::MatrixXd coefficients = values.inverse();
  const std::vector<int>& by_position = nodes_by_position(shape, space.order);
  const auto side = std::size_t(space.order) + 1;
  Eigen::MatrixXd chosen(Eigen::Index(positions.size()), coefficients.cols());
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const auto& at = positions[i];
    chosen.row(Eigen::Index(i)) =
        coefficients.row(by_position[std::size_t(at[0]) + side * (std::size_t(at[1]) + side * std::size_t(at[2]))]);
  }
  return chosen;
}

/// The inner points of MFEM's pyramid: those of a cube, shrunk towards the apex.
std::vector<std::array<double, 3>> pyramid_inside(int order) {
  const std::vector<double> line = line_points(Basis::GaussLobatto, order);
  std::vector<std::array<double, 3>> places;
  for (std::size_t k = 1; k < std::size_t(order); ++k)
    for (std::size_t j = 1; j < std::size_t(order); ++j)
      for (std::size_t i = 1; i < std::size_t(order); ++i)
        places.push_back({line[i] * (1 - line[k]), line[j] * (1 - line[k]), line[k]});
  return places;
}

MfemConversion discontinuous(const MfemSpace& space, Shape shape) {
  MfemConversion made;
  made.to_file = dofs_from_nodes(space, shape, node_positions(NodeOrder::Rows, shape, space.order));
  made.to_nodes = cleaned(made.to_file.inverse());
  made.to_file = cleaned(made.to_file);
  return made;
}

/// The degrees of freedom on the boundary of the cell in Gmsh's order, from the nodes there.
Eigen::MatrixXd boundary_dofs(const MfemSpace& space, Shape shape, Eigen::Index count) {
  Positions positions = node_positions(NodeOrder::Gmsh, shape, space.order);
  positions.resize(std::size_t(count));
  return dofs_from_nodes(space, shape, positions).leftCols(count);
}

MfemConversion continuous(const MfemSpace& space, Shape shape) {
  MfemConversion made;
  const int nodes = reference::node_count(shape, space.order), inner = inner_node_count(shape, space.order);
  const Eigen::Index boundary = nodes - inner;
  if (shape == Shape::Pyramid) {
    made.to_file = values_at(shape, space.order, pyramid_inside(space.order));
  } else {
    const Positions& all = node_positions(NodeOrder::Mfem, shape, space.order);
    made.to_file = dofs_from_nodes(space, shape, {all.end() - inner, all.end()});
  }
  // File = O boundary nodes + I inner nodes; boundary nodes = B⁻¹ boundary dofs. If there are more inner degrees of
  // freedom than inner nodes, in pyramids, the inner nodes are those of least squares.
  const Eigen::Index dofs = made.to_file.rows();
  Eigen::MatrixXd rest(dofs, boundary + dofs);
  rest << -made.to_file.leftCols(boundary) * boundary_dofs(space, shape, boundary).inverse(),
      Eigen::MatrixXd::Identity(dofs, dofs);
  const Eigen::MatrixXd own = made.to_file.rightCols(inner);
  if (inner == 0)
    made.to_nodes = Eigen::MatrixXd(0, boundary + dofs);
  else if (inner == dofs)
    made.to_nodes = own.partialPivLu().solve(rest);
  else
    made.to_nodes = own.colPivHouseholderQr().solve(rest);
  if (shape == Shape::Pyramid) made.left = rest - own * made.to_nodes;
  made.to_nodes = cleaned(made.to_nodes);
  made.to_file = cleaned(made.to_file);
  return made;
}

}  // namespace

Expected<MfemSpace> mfem_space(std::string_view name) {
  for (const OldName& old : kOldNames)
    if (old.name == name) return MfemSpace{old.basis, true, old.order, std::string(name)};
  for (const Prefix& prefix : kPrefixes) {
    if (!name.starts_with(prefix.name)) continue;
    const auto order = order_of(name.substr(prefix.name.size()));
    if (!order) break;
    if (*order < 1 || *order > kMaxOrder)
      return bad_input("The nodes have order " + std::to_string(*order) + "; VariMesh takes orders 1 to " +
                       std::to_string(kMaxOrder) + ".");
    return MfemSpace{prefix.basis, prefix.continuous, *order, std::string(name)};
  }
  return bad_input("VariMesh cannot read nodes in the space '" + std::string(name.substr(0, 40)) +
                   "'; save the mesh after Mesh::SetCurvature(order), which gives it an H1 space.");
}

MfemSpace default_mfem_space(int dimension, int order) {
  return {Basis::GaussLobatto, true, order, "H1_" + std::to_string(dimension) + "D_P" + std::to_string(order)};
}

std::string why_not_in_space(const MfemSpace& space, Shape shape) {
  const bool pyramid = shape == Shape::Pyramid;
  const bool solid = shape == Shape::Hexahedron || shape == Shape::Prism || pyramid;
  const bool default_space = space.continuous && space.basis == Basis::GaussLobatto;
  if ((pyramid && !default_space && (space.order > 1 || space.basis == Basis::Positive)) ||
      (pyramid && !space.continuous) || (space.name == "Cubic" && solid))
    return "VariMesh does not know the order of the nodes of " + std::string(reference::info(shape).plural) +
           " in the space '" + space.name +
           "'; save the mesh after Mesh::SetCurvature(order), which gives it an H1 space";
  return {};
}

int inner_node_count(Shape shape, int order) {
  const auto& places = reference::node_places(shape, order);
  const int d = reference::info(shape).dimension;
  int count = 0;
  for (const reference::NodePlace& each : places) count += each.dimension == d ? 1 : 0;
  return count;
}

int mfem_interior_count(const MfemSpace& space, Shape shape) {
  if (!space.continuous) return reference::node_count(shape, space.order);
  if (shape == Shape::Pyramid) return (space.order - 1) * (space.order - 1) * (space.order - 1);
  return inner_node_count(shape, space.order);
}

const MfemConversion& mfem_conversion(const MfemSpace& space, Shape shape) {
  static reference::Cache<std::array<int, 4>, MfemConversion> cache;
  return cache.get({int(space.basis), space.continuous, space.order, int(shape)},
                   [&] { return space.continuous ? continuous(space, shape) : discontinuous(space, shape); });
}

}  // namespace varimesh::formats
