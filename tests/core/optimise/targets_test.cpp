// What the targets are, matrix by matrix, and the meshes that they lead to.
#include "core/optimise/targets.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "core/energy/density.h"
#include "core/optimise/door.h"
#include "core/optimise/kernels.h"
#include "core/optimise/optimiser.h"
#include "core/reference/basis.h"
#include "core/reference/quadrature.h"
#include "tests/core/optimise/meshes.h"

namespace varimesh {
namespace {

using Eigen::MatrixXd;
using testing::Filling;
using testing::Place;

// === Matrix by matrix ====================================================================================

Problem make_problem(const HighOrderMesh& mesh, const Options& options) {
  const auto field = resolve_target_field(mesh, options);
  EXPECT_TRUE(field) << field.error().sentence;
  Problem problem = build_problem(mesh, fixed_nodes(mesh), 0);
  const Frame frame = frame_of(mesh);
  problem.positions = positions_at_door(mesh, frame);
  set_targets(problem, mesh, *field, frame.diagonal);
  return problem;
}

// A in the mesh's own unit of length.
MatrixXd target_at(const CellBlock& block, std::int32_t cell, int point, double diagonal) {
  const int d = block.dimension;
  MatrixXd inverse(d, d);
  for (int i = 0; i < d; ++i)
    for (int j = 0; j < d; ++j)
      inverse(i, j) = block.affine ? block.inverse_target_of(cell)[i * d + j]
                                   : block.inverse_target_of(cell)[(i * d + j) * block.stride + point];
  return diagonal * inverse.inverse();
}

// ∇χ_L, from the mesh's vertices alone.
MatrixXd straight_at(const HighOrderMesh& mesh, const CellBlock& block, std::int32_t cell, int point) {
  const auto rule = reference::quadrature(block.shape, block.order, block.degree);
  const auto gradients =
      reference::basis_gradients(block.shape, 1, reference::NodeSet::Equispaced, block.dimension, rule.points);
  MatrixXd A = MatrixXd::Zero(block.dimension, block.dimension);
  for (int v = 0; v < reference::info(block.shape).vertices; ++v)
    for (int k = 0; k < block.dimension; ++k)
      for (int i = 0; i < block.dimension; ++i)
        A(i, k) += mesh.coordinates[std::size_t(3 * block.nodes[std::size_t(cell * block.nodes_per_cell + v)] + i)] *
                   gradients[std::size_t(k)](point, v);
  return A;
}

// The lengths of a cell's edges as its target A sees them, with a metric: eᵀAᵀMAe for each reference edge e.
std::vector<double> edge_lengths(const CellBlock& block, const MatrixXd& A, const MatrixXd& metric) {
  const reference::ShapeInfo& shape = reference::info(block.shape);
  std::vector<double> lengths;
  for (const auto& edge : shape.edges) {
    Eigen::VectorXd e(block.dimension);
    for (int k = 0; k < block.dimension; ++k)
      e[k] = shape.vertex[std::size_t(edge[1])][std::size_t(k)] - shape.vertex[std::size_t(edge[0])][std::size_t(k)];
    lengths.push_back(std::sqrt(e.dot(A.transpose() * metric * A * e)));
  }
  return lengths;
}

class Targets : public ::testing::TestWithParam<Filling> {
 protected:
  int dimension() const { return testing::is_plane(GetParam()) ? 2 : 3; }
  HighOrderMesh mesh(int order) const {
    return testing::grid(GetParam(), {3, 2, 2}, order, testing::bent(dimension()));
  }

  template <class Check>
  void for_each_target(const HighOrderMesh& mesh, const Options& options, Check check) const {
    const Problem problem = make_problem(mesh, options);
    const double diagonal = frame_of(mesh).diagonal;
    for (const CellBlock& block : problem.blocks)
      for (std::int32_t cell = 0; cell < block.count; ++cell)
        for (int q = 0; q < block.points; q += 7)
          check(block, cell, q, target_at(block, cell, q, diagonal), straight_at(mesh, block, cell, q));
  }
};

INSTANTIATE_TEST_SUITE_P(EveryFilling, Targets, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& p) { return testing::name(p.param); });

TEST_P(Targets, StraightSidedIsTheGradientOfTheVerticesMap) {
  for_each_target(mesh(2), {}, [](const auto&, int, int, const MatrixXd& A, const MatrixXd& L) {
    EXPECT_LT((A - L).norm(), 1e-13);
  });
}

TEST_P(Targets, IdealIsRegularAndOfTheSameVolume) {
  Options options;
  options.target = Target::Ideal;
  const HighOrderMesh mesh = this->mesh(2);
  for_each_target(mesh, options, [&](const CellBlock& block, int, int, const MatrixXd& A, const MatrixXd& L) {
    const auto lengths = edge_lengths(block, A, MatrixXd::Identity(A.rows(), A.rows()));
    for (const double length : lengths) EXPECT_NEAR(length, lengths[0], 1e-13);
    EXPECT_GT(A.determinant() * L.determinant(), 0);
  });
  const Problem straight = make_problem(mesh, {}), ideal = make_problem(mesh, options);
  for (std::size_t b = 0; b < ideal.blocks.size(); ++b)
    for (std::int32_t cell = 0; cell < ideal.blocks[b].count; ++cell) {
      double before = 0, after = 0;
      for (int q = 0; q < (ideal.blocks[b].affine ? 1 : ideal.blocks[b].stride); ++q) {
        before += straight.blocks[b].measure_of(cell)[q];
        after += ideal.blocks[b].measure_of(cell)[q];
      }
      EXPECT_NEAR(after, before, 1e-13);
    }
}

TEST_P(Targets, ANumberIsTheLengthOfEveryEdge) {
  Options options;
  options.target = Target::Size;
  const HighOrderMesh mesh = this->mesh(2);
  options.target_field.values.assign(mesh.element_count(mesh.dimension), 0.17);
  for_each_target(mesh, options, [&](const CellBlock& block, int, int, const MatrixXd& A, const MatrixXd&) {
    for (const double length : edge_lengths(block, A, MatrixXd::Identity(A.rows(), A.rows())))
      EXPECT_NEAR(length, 0.17, 1e-13);
  });
}

TEST_P(Targets, EveryEdgeHasLengthOneInTheMetricGiven) {
  const int d = dimension();
  MatrixXd metric(d, d);
  if (d == 2)
    metric << 30, 7, 7, 400;
  else
    metric << 30, 7, -5, 7, 400, 20, -5, 20, 90;
  Options options;
  options.target = Target::Size;
  options.target_field.per = Per::Vertex;
  options.target_field.components = d * (d + 1) / 2;
  const HighOrderMesh mesh = this->mesh(2);
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    for (int i = 0; i < d; ++i)
      for (int j = 0; j <= i; ++j) options.target_field.values.push_back(metric(i, j));
  for_each_target(mesh, options, [&](const CellBlock& block, int, int, const MatrixXd& A, const MatrixXd&) {
    for (const double length : edge_lengths(block, A, metric)) EXPECT_NEAR(length, 1, 1e-12);
  });
}

TEST_P(Targets, SizesAtVerticesAreLinearInBetween) {
  Options options;
  options.target = Target::Size;
  options.target_field.per = Per::Vertex;
  const HighOrderMesh mesh = testing::grid(GetParam(), {2, 2, 2}, 2);
  const auto size = [](double x, double y) { return 0.3 + 0.1 * x - 0.2 * y; };
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    options.target_field.values.push_back(size(mesh.coordinates[3 * n], mesh.coordinates[3 * n + 1]));
  const Problem problem = make_problem(mesh, options);
  const double diagonal = frame_of(mesh).diagonal;
  for (const CellBlock& block : problem.blocks) {
    const auto rule = reference::quadrature(block.shape, block.order, block.degree);
    const MatrixXd values =
        reference::basis_values(block.shape, 1, reference::NodeSet::Equispaced, block.dimension, rule.points);
    for (std::int32_t cell = 0; cell < block.count; ++cell)
      for (int q = 0; q < block.points; ++q) {
        double x = 0, y = 0;
        for (int v = 0; v < values.cols(); ++v) {
          const auto node = std::size_t(block.nodes[std::size_t(cell * block.nodes_per_cell + v)]);
          x += values(q, v) * mesh.coordinates[3 * node];
          y += values(q, v) * mesh.coordinates[3 * node + 1];
        }
        const MatrixXd A = target_at(block, cell, q, diagonal);
        EXPECT_NEAR(edge_lengths(block, A, MatrixXd::Identity(A.rows(), A.rows()))[0], size(x, y), 1e-12);
      }
  }
}

TEST_P(Targets, StrainScalesTheStraightSidedCell) {
  Options options;
  options.target = Target::Strain;
  const HighOrderMesh mesh = this->mesh(2);
  const std::int64_t heated = mesh.blocks[0].numbers[0];
  options.target_field.numbers = {heated};
  options.target_field.values = {0.25};
  for_each_target(mesh, options, [&](const CellBlock& block, int cell, int, const MatrixXd& A, const MatrixXd& L) {
    const bool is_heated = block.shape == mesh.blocks[0].shape && cell == 0;
    EXPECT_LT((A - (is_heated ? 1.25 : 1.0) * L).norm(), 1e-13);
  });
}

// A rotated regular cell is its own ideal, which it is only with the rotation found.
TEST(TargetsRotation, ARegularCellIsItsOwnIdeal) {
  const auto turn = [](Place at) { return Place{0.8 * at[0] - 0.6 * at[1], 0.6 * at[0] + 0.8 * at[1], at[2]}; };
  for (const bool clockwise : {false, true})
    for (const Filling filling : {Filling::Quadrilaterals, Filling::Hexahedra}) {
      const HighOrderMesh mesh = testing::grid(filling, {2, 2, 2}, 2, [&](Place at) {
        if (clockwise) at[0] = -at[0];
        return turn(at);
      });
      Options options;
      options.target = Target::Ideal;
      const Problem problem = make_problem(mesh, options);
      for (int q = 0; q < problem.blocks[0].points; ++q)
        EXPECT_LT(
            (target_at(problem.blocks[0], 1, q, frame_of(mesh).diagonal) - straight_at(mesh, problem.blocks[0], 1, q))
                .norm(),
            1e-13);
    }
}

// Mean ratio by edge lengths: 4√3 A/Σl² of a triangle, 12 (3V)^(2/3)/Σl² of a tetrahedron (A. Liu, B. Joe, BIT 34,
// 1994).
template <int d>
double mean_ratio(const HighOrderMesh& mesh, std::span<const std::int32_t> nodes) {
  Eigen::Matrix<double, d, d> edges;
  double squares = 0;
  for (int a = 0; a <= d; ++a)
    for (int b = 0; b < a; ++b) {
      Eigen::Matrix<double, d, 1> edge;
      for (int k = 0; k < d; ++k)
        edge[k] = mesh.coordinates[std::size_t(3 * nodes[std::size_t(a)] + k)] -
                  mesh.coordinates[std::size_t(3 * nodes[std::size_t(b)] + k)];
      squares += edge.squaredNorm();
      if (b == 0) edges.col(a - 1) = edge;
    }
  const double V = edges.determinant() / (d == 2 ? 2 : 6);
  return d == 2 ? 4 * std::sqrt(3.0) * V / squares : 12 * std::pow(3 * V, 2.0 / 3) / squares;
}

template <int d>
void expect_inverse_mean_ratio(Filling filling) {
  const HighOrderMesh mesh = testing::grid(filling, {3, 2, 2}, 1, testing::bent(d));
  Options options;
  options.target = Target::Ideal;
  options.energy = Energy::Distortion;
  const Problem problem = make_problem(mesh, options);
  const Cells cells(mesh, d);
  for (std::int32_t cell = 0; cell < problem.cells; ++cell) {
    const MatrixXd A = target_at(problem.blocks[0], cell, 0, frame_of(mesh).diagonal);
    const Eigen::Matrix<double, d, d> F = straight_at(mesh, problem.blocks[0], cell, 0) * A.inverse();
    EXPECT_NEAR(energy_density<d>(material(options), F, 0.0), 1 / mean_ratio<d>(mesh, cells.nodes(std::size_t(cell))),
                1e-12);
  }
}

TEST(InverseMeanRatio, IsTheDistortionEnergyWithTheIdealTarget) {
  expect_inverse_mean_ratio<2>(Filling::Triangles);
  expect_inverse_mean_ratio<3>(Filling::Tetrahedra);
}

// === Meshes ==============================================================================================

Options exactly() {
  Options options;
  options.tolerance = 1e-10;
  options.threads = 1;
  return options;
}

// The patch test with the straight-sided cells themselves moved: the size alone knows where they were.
TEST(SizedMeshes, ReturnToTheRegularMeshOfThatSize) {
  const double root3 = std::sqrt(3.0);
  const auto cubes = [](Place at) { return Place{4 * at[0], 3 * at[1], 2 * at[2]}; };
  // The squares' diagonals are the short ones after this shear, so that the triangles are equilateral.
  const auto sheared = [&](Place at) { return Place{4 * at[0] - 1.5 * at[1], 1.5 * root3 * at[1], 2 * at[2]}; };
  for (const Filling filling : {Filling::Quadrilaterals, Filling::Triangles, Filling::Hexahedra, Filling::Prisms}) {
    const bool on_triangles = filling == Filling::Triangles || filling == Filling::Prisms;
    const HighOrderMesh wanted =
        testing::grid(filling, {4, 3, 2}, 2, on_triangles ? testing::Map(sheared) : testing::Map(cubes));
    for (const Energy energy : {Energy::Hyperelastic, Energy::LinearElastic, Energy::Winslow, Energy::Distortion}) {
      for (const Target target : {Target::Size, Target::Ideal}) {
        // The ideal shape follows the volumes of the cells that came in, so vertices are left alone there.
        const auto which = target == Target::Size ? testing::Shaken::AllInterior : testing::Shaken::NotVertices;
        Options options = exactly();
        options.energy = energy;
        options.target = target;
        if (target == Target::Size) options.target_field.values.assign(wanted.element_count(wanted.dimension), 1.0);
        HighOrderMesh mesh = wanted;
        testing::shake(mesh, 0.06, 5, which);
        const auto result = optimise(mesh, options);
        ASSERT_TRUE(result) << result.error().sentence;
        EXPECT_LT(testing::distance(result->mesh, wanted), 1e-8) << testing::name(filling) << " " << int(energy);
      }
    }
  }
}

// Areas of the cells, by the corners of quadrilaterals: straight-sided results only need that.
std::vector<double> areas(const HighOrderMesh& mesh) {
  std::vector<double> result;
  Options options;
  const Problem problem = make_problem(mesh, options);
  const double diagonal = frame_of(mesh).diagonal;
  const auto kernels = make_plain_kernels(material(options), 2);
  for (CellBlock block : problem.blocks)
    for (std::int32_t cell = 0; cell < block.count; ++cell) {
      kernels->rebuild(block, cell, problem.positions);
      double area = 0;
      for (int q = 0; q < block.points; ++q) {
        const double* F = block.deformation_of(cell) + q;
        const double J = F[0] * F[3 * block.stride] - F[block.stride] * F[2 * block.stride];
        area +=
            J * (block.affine ? block.weights[std::size_t(q)] * block.measure_of(cell)[0] : block.measure_of(cell)[q]);
      }
      result.push_back(area * diagonal * diagonal);
    }
  return result;
}

// A square whose columns and rows grow by equal steps, from 0.8 to 1.2 of the mean; its boundary follows.
Place graded(Place at) {
  const auto grow = [](double t) { return 0.8 * t + 0.2 * t * t; };
  return {grow(at[0]), grow(at[1]), 0};
}

// The graded square with its inner vertices where an even grid has them.
HighOrderMesh with_even_inside(Filling filling, std::array<int, 3> counts, int order, const testing::Map& map) {
  HighOrderMesh linear = testing::grid(filling, counts, 1);
  const std::vector<bool> fixed = fixed_nodes(linear);
  for (std::size_t n = 0; n < linear.node_count(); ++n) {
    double* x = linear.coordinates.data() + 3 * n;
    const Place to = map({x[0], x[1], x[2]});
    if (fixed[n]) std::copy(to.begin(), to.end(), x);
  }
  return *change_order(linear, order);
}

TEST(SizedMeshes, ASquareWhoseBoundaryFollowsTheFieldFollowsItInside) {
  for (const int order : {1, 3}) {
    const HighOrderMesh wanted = testing::grid(Filling::Quadrilaterals, {8, 8, 0}, order, graded);
    const std::vector<double> sizes = areas(wanted);
    Options options = exactly();
    options.target = Target::Size;
    for (const double area : sizes) options.target_field.values.push_back(std::sqrt(area));
    const HighOrderMesh start = with_even_inside(Filling::Quadrilaterals, {8, 8, 0}, order, graded);
    const auto result = optimise(start, options);
    ASSERT_TRUE(result) << result.error().sentence;
    const std::vector<double> before = areas(start), after = areas(result->mesh);
    double worst_before = 0, worst = 0;
    for (std::size_t i = 0; i < after.size(); ++i) {
      worst_before = std::max(worst_before, std::abs(before[i] / sizes[i] - 1));
      worst = std::max(worst, std::abs(after[i] / sizes[i] - 1));
    }
    EXPECT_GT(worst_before, 0.2);
    EXPECT_LT(worst, 0.05) << "order " << order;
  }
}

// Four times as fine in y as in x.
TEST(SizedMeshes, ASquareFollowsAMetricOfRatioFour) {
  const std::array<int, 3> counts{4, 16, 0};
  const HighOrderMesh wanted = testing::grid(Filling::Quadrilaterals, counts, 2, graded);
  Options options = exactly();
  options.target = Target::Size;
  options.target_field.components = 3;
  const Cells cells(wanted, 2);
  for (std::size_t cell = 0; cell < cells.count(); ++cell) {
    const auto corner = [&](int v, int k) {
      return wanted.coordinates[std::size_t(3 * cells.nodes(cell)[std::size_t(v)] + k)];
    };
    const double width = corner(1, 0) - corner(0, 0), height = corner(3, 1) - corner(0, 1);
    for (const double entry : {1 / (width * width), 0.0, 1 / (height * height)})
      options.target_field.values.push_back(entry);
  }
  const auto result = optimise(with_even_inside(Filling::Quadrilaterals, counts, 2, graded), options);
  ASSERT_TRUE(result) << result.error().sentence;
  const std::vector<double> sizes = areas(wanted), after = areas(result->mesh);
  for (std::size_t i = 0; i < after.size(); ++i) EXPECT_NEAR(after[i] / sizes[i], 1, 0.05);
}

// === A boundary layer ====================================================================================

constexpr double kWidth = 1.0 / 8, kHeight = kWidth / 100;
constexpr int kLayers = 4;

double wall(double x) { return 0.1 * std::sin(3.14159265358979323846 * x); }

// Four layers of quadrilaterals a hundred times as wide as high on a curved wall, and larger ones above. The wall's
// nodes are on the curve, everything else is straight-sided, so that the layers begin inverted.
HighOrderMesh boundary_layer(int order) {
  const int rows = 10;
  const auto height = [&](double t) {
    const double row = t * rows;
    return row <= kLayers ? row * kHeight : kLayers * kHeight + (row - kLayers) / (rows - kLayers) * 0.6;
  };
  HighOrderMesh mesh = testing::grid(Filling::Quadrilaterals, {8, rows, 0}, order, [&](Place at) {
    const double y = height(at[1]), fade = std::max(0.0, 1 - y / 0.6);
    return Place{at[0], y + (y <= kLayers * kHeight ? 1.0 : fade) * wall(at[0]), 0};
  });
  for (const std::int32_t node : testing::side_nodes(mesh, 3))
    mesh.coordinates[std::size_t(3 * node + 1)] = wall(mesh.coordinates[std::size_t(3 * node)]);
  return mesh;
}

// The largest relative change of a layer's height, measured across each cell along ξ = constant, normal to the wall.
double height_error(const HighOrderMesh& mesh) {
  const Cells cells(mesh, 2);
  reference::Points at(10, 2);
  for (int i = 0; i < 5; ++i) {
    at.row(2 * i) << -1 + 0.5 * i, -1;
    at.row(2 * i + 1) << -1 + 0.5 * i, 1;
  }
  const MatrixXd values =
      reference::basis_values(Shape::Quadrilateral, mesh.order, reference::NodeSet::Equispaced, 2, at);
  double worst = 0;
  for (std::size_t cell = 0; cell < std::size_t(8 * kLayers); ++cell)
    for (int i = 0; i < 5; ++i) {
      double from[2] = {0, 0}, to[2] = {0, 0};
      for (Eigen::Index n = 0; n < values.cols(); ++n)
        for (int k = 0; k < 2; ++k) {
          const double x = mesh.coordinates[std::size_t(3 * cells.nodes(cell)[std::size_t(n)] + k)];
          from[k] += values(2 * i, n) * x;
          to[k] += values(2 * i + 1, n) * x;
        }
      // The vertices of the layers stand above one another, so heights are vertical ones.
      worst = std::max(worst, std::abs((to[1] - from[1]) / kHeight - 1));
    }
  return worst;
}

TEST(BoundaryLayer, KeepsItsHeightsUnderTheStraightSidedTarget) {
  const HighOrderMesh mesh = boundary_layer(4);
  Options options;
  options.tolerance = 1e-9;
  const auto result = optimise(mesh, options);
  ASSERT_TRUE(result) << result.error().sentence;
  EXPECT_GT(result->before.invalid_elements, 0);
  EXPECT_EQ(result->after.invalid_elements, 0);
  EXPECT_LT(height_error(result->mesh), 0.05);
}

TEST(BoundaryLayer, KeepsItsHeightsUnderAMetric) {
  const HighOrderMesh mesh = boundary_layer(4);
  Options options;
  options.tolerance = 1e-9;
  options.target = Target::Size;
  options.target_field.components = 3;
  // Across the vertical heights h and along the wall's slope s: the cell's own edges (w, w s) and (0, h) have length 1.
  const Cells cells(mesh, 2);
  for (std::size_t cell = 0; cell < cells.count(); ++cell) {
    const auto corner = [&](int v, int k) {
      return mesh.coordinates[std::size_t(3 * cells.nodes(cell)[std::size_t(v)] + k)];
    };
    Eigen::Matrix2d A;
    A << corner(1, 0) - corner(0, 0), corner(3, 0) - corner(0, 0), corner(1, 1) - corner(0, 1),
        corner(3, 1) - corner(0, 1);
    const Eigen::Matrix2d M = (A * A.transpose()).inverse();
    for (const double entry : {M(0, 0), M(1, 0), M(1, 1)}) options.target_field.values.push_back(entry);
  }
  const auto result = optimise(mesh, options);
  ASSERT_TRUE(result) << result.error().sentence;
  EXPECT_EQ(result->after.invalid_elements, 0);
  EXPECT_LT(height_error(result->mesh), 0.05);
}

TEST(StrainedMeshes, WhatIsHeatedGrows) {
  const HighOrderMesh mesh = testing::grid(Filling::Triangles, {4, 4, 0}, 2);
  Options options;
  options.target = Target::Strain;
  const std::int64_t heated = mesh.blocks[0].numbers[12];
  options.target_field.numbers = {heated};
  options.target_field.values = {0.3};
  const auto result = optimise(mesh, options);
  ASSERT_TRUE(result) << result.error().sentence;
  const std::vector<double> before = areas(mesh), after = areas(result->mesh);
  EXPECT_GT(after[12], 1.1 * before[12]);
  EXPECT_LT(after[12], 1.69 * before[12]);
}

// === Fields from text, and refusals ======================================================================

TEST(TargetFieldText, HoldsNumbersOrTensorsByElementOrNode) {
  const auto sizes = read_target_field("# sizes\nelements\n 7 0.5\n\n12 1e-3 # small\n");
  ASSERT_TRUE(sizes) << sizes.error().sentence;
  EXPECT_EQ(sizes->per, Per::Cell);
  EXPECT_EQ(sizes->components, 1);
  EXPECT_EQ(sizes->numbers, (std::vector<std::int64_t>{7, 12}));
  EXPECT_EQ(sizes->values, (std::vector<double>{0.5, 1e-3}));
  const auto metric = read_target_field("nodes\n1 4 0 16\n2 4 1 16");
  ASSERT_TRUE(metric) << metric.error().sentence;
  EXPECT_EQ(metric->per, Per::Vertex);
  EXPECT_EQ(metric->components, 3);
}

TEST(TargetFieldText, NamesTheLineThatIsWrong) {
  for (const auto& [text, line] : {std::pair{"1 0.5\n", "Line 1"},
                                   {"elements\n1 0.5\nx 0.5\n", "Line 3"},
                                   {"elements\n1\n", "Line 2"},
                                   {"elements\n1 2 3 4\n5 6\n", "Line 3"},
                                   {"nodes\n1 nope\n", "Line 2"},
                                   {"nodes\n", "Line 1"}}) {
    const auto read = read_target_field(text);
    ASSERT_FALSE(read) << text;
    EXPECT_NE(read.error().sentence.find(line), std::string::npos) << read.error().sentence;
  }
}

TEST(TargetFieldOnAMesh, IsRefusedWithASentenceWhereItDoesNotFit) {
  const HighOrderMesh mesh = testing::grid(Filling::Triangles, {2, 2, 0}, 2);
  const auto sentence = [&](Target target, TargetField field) {
    Options options;
    options.target = target;
    options.target_field = std::move(field);
    const auto refused = optimise(mesh, options);
    return refused ? std::string("taken") : refused.error().sentence;
  };
  const auto expect = [](const std::string& sentence, const std::string& word) {
    EXPECT_NE(sentence.find(word), std::string::npos) << sentence;
  };
  expect(sentence(Target::Size, {}), "empty");
  expect(sentence(Target::Ideal, {Per::Cell, 1, {1}, {1.0}}), "takes none");
  expect(sentence(Target::Size, {Per::Cell, 1, {1}, {1.0}}), "no size for element 2");
  expect(sentence(Target::Size, {Per::Vertex, 1, {1}, {1.0}}), "no size for node 2");
  expect(sentence(Target::Size, {Per::Cell, 1, {1, 1}, {1.0, 1.0}}), "twice");
  expect(sentence(Target::Size, {Per::Cell, 1, {999}, {1.0}}), "element 999");
  expect(sentence(Target::Size, {Per::Cell, 1, {1}, {-1.0}}), "not positive");
  expect(sentence(Target::Size, {Per::Cell, 3, {1}, {1.0, 2.0, 1.0}}), "not positive");
  expect(sentence(Target::Size, {Per::Cell, 6, {1}, {1, 0, 1, 0, 0, 1}}), "components");
  expect(sentence(Target::Size, {Per::Cell, 1, {}, {1.0}}), "8 cells");
  expect(sentence(Target::Strain, {Per::Cell, 1, {3}, {-1.0}}), "leaves nothing");
}

}  // namespace
}  // namespace varimesh
