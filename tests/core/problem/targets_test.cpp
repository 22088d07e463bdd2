// What the targets are, matrix by matrix, and which fields are taken.
#include "core/problem/targets.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "core/energy/density.h"
#include "core/optimise/optimiser.h"
#include "core/problem/node_conversion.h"
#include "core/reference/basis.h"
#include "core/reference/quadrature.h"
#include "tests/core/support/meshes.h"

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
  problem.positions = solver_positions(mesh, frame);
  set_targets(problem, *field, frame.diagonal);
  return problem;
}

// What ∇χ_M is wanted to be, but for a rotation where there is a metric: L⁻¹ A, in the mesh's own unit of length.
MatrixXd target_at(const CellSet& block, std::int32_t cell, int point, double diagonal) {
  const int d = block.dimension;
  MatrixXd inverse(d, d);
  for (int i = 0; i < d; ++i)
    for (int j = 0; j < d; ++j)
      inverse(i, j) = block.affine ? block.inverse_target_of(cell)[i * d + j]
                                   : block.inverse_target_of(cell)[(i * d + j) * block.stride + point];
  MatrixXd factor = MatrixXd::Identity(d, d);
  for (int i = 0; i < d * d && block.left_factor_of(cell) != nullptr; ++i)
    factor(i / d, i % d) = block.left_factor_of(cell)[i];
  return diagonal * (inverse * factor).inverse();
}

// ∇χ_L, from the mesh's vertices alone.
MatrixXd straight_at(const HighOrderMesh& mesh, const CellSet& block, std::int32_t cell, int point) {
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
std::vector<double> edge_lengths(const CellSet& block, const MatrixXd& A, const MatrixXd& metric) {
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
    for (const CellSet& block : problem.sets)
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
  for_each_target(mesh, options, [&](const CellSet& block, int, int, const MatrixXd& A, const MatrixXd& L) {
    const auto lengths = edge_lengths(block, A, MatrixXd::Identity(A.rows(), A.rows()));
    for (const double length : lengths) EXPECT_NEAR(length, lengths[0], 1e-13);
    EXPECT_GT(A.determinant() * L.determinant(), 0);
  });
  const Problem straight = make_problem(mesh, {}), ideal = make_problem(mesh, options);
  for (std::size_t b = 0; b < ideal.sets.size(); ++b)
    for (std::int32_t cell = 0; cell < ideal.sets[b].count; ++cell) {
      double before = 0, after = 0;
      for (int q = 0; q < (ideal.sets[b].affine ? 1 : ideal.sets[b].stride); ++q) {
        before += straight.sets[b].measure_of(cell)[q];
        after += ideal.sets[b].measure_of(cell)[q];
      }
      EXPECT_NEAR(after, before, 1e-13);
    }
}

TEST_P(Targets, ANumberIsTheLengthOfEveryEdge) {
  Options options;
  options.target = Target::Size;
  const HighOrderMesh mesh = this->mesh(2);
  options.target_field.values.assign(mesh.element_count(mesh.dimension), 0.17);
  for_each_target(mesh, options, [&](const CellSet& block, int, int, const MatrixXd& A, const MatrixXd&) {
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
  for_each_target(mesh, options, [&](const CellSet& block, int, int, const MatrixXd& A, const MatrixXd&) {
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
  for (const CellSet& block : problem.sets) {
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
  for_each_target(mesh, options, [&](const CellSet& block, int cell, int, const MatrixXd& A, const MatrixXd& L) {
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
      for (int q = 0; q < problem.sets[0].points; ++q)
        EXPECT_LT((target_at(problem.sets[0], 1, q, frame_of(mesh).diagonal) - straight_at(mesh, problem.sets[0], 1, q))
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
    const MatrixXd A = target_at(problem.sets[0], cell, 0, frame_of(mesh).diagonal);
    const Eigen::Matrix<double, d, d> F = straight_at(mesh, problem.sets[0], cell, 0) * A.inverse();
    const auto nodes = cells.nodes(std::size_t(problem.sets[0].mesh_cell[std::size_t(cell)]));
    EXPECT_NEAR(energy_density<d>(material(options), F, 0.0), 1 / mean_ratio<d>(mesh, nodes), 1e-12);
  }
}

TEST(InverseMeanRatio, IsTheDistortionEnergyWithTheIdealTarget) {
  expect_inverse_mean_ratio<2>(Filling::Triangles);
  expect_inverse_mean_ratio<3>(Filling::Tetrahedra);
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
  expect(sentence(Target::Strain, {Per::Cell, 1, {3}, {-1.0}}), "not above -1");
}

}  // namespace
}  // namespace varimesh
