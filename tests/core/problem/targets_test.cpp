// The targets, matrix by matrix.
#include "core/problem/targets.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "core/energy/density.h"
#include "core/problem/node_conversion.h"
#include "core/reference/basis.h"
#include "core/reference/quadrature.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using Eigen::MatrixXd;
using testing::Filling;
using testing::Place;

Problem make_problem(const HighOrderMesh& mesh, const Options& options) {
  const auto field = resolve_target_field(mesh, options);
  EXPECT_TRUE(field) << field.error().sentence;
  Problem problem = build_problem(mesh, fixed_nodes(mesh), 0);
  const Frame frame = frame_of(mesh);
  problem.positions = solver_positions(mesh, frame);
  set_targets(problem, *field, frame.diagonal);
  return problem;
}

// The target of ∇χ_M: L⁻¹ A, in the mesh's own unit of length. With a metric it holds up to a rotation.
MatrixXd target_at(const CellSet& set, std::int32_t cell, int point, double diagonal) {
  const int d = set.dimension;
  MatrixXd inverse(d, d);
  for (int i = 0; i < d; ++i)
    for (int j = 0; j < d; ++j)
      inverse(i, j) = set.affine ? set.inverse_target_of(cell)[i * d + j]
                                 : set.inverse_target_of(cell)[(i * d + j) * set.stride + point];
  MatrixXd factor = MatrixXd::Identity(d, d);
  for (int i = 0; i < d * d && set.left_factor_of(cell) != nullptr; ++i)
    factor(i / d, i % d) = set.left_factor_of(cell)[i];
  return diagonal * (inverse * factor).inverse();
}

// ∇χ_L, from the mesh's vertices only.
MatrixXd straight_at(const HighOrderMesh& mesh, const CellSet& set, std::int32_t cell, int point) {
  const auto rule = reference::quadrature(set.shape, set.order, set.degree);
  const auto gradients =
      reference::basis_gradients(set.shape, 1, reference::NodeSet::Equispaced, set.dimension, rule.points);
  MatrixXd A = MatrixXd::Zero(set.dimension, set.dimension);
  for (int v = 0; v < reference::info(set.shape).vertices; ++v)
    for (int k = 0; k < set.dimension; ++k)
      for (int i = 0; i < set.dimension; ++i)
        A(i, k) += mesh.coordinates[std::size_t(3 * set.nodes[std::size_t(cell * set.nodes_per_cell + v)] + i)] *
                   gradients[std::size_t(k)](point, v);
  return A;
}

// The lengths of a cell's edges under its target A and a metric M: √(eᵀAᵀMAe) for each reference edge e.
std::vector<double> edge_lengths(const CellSet& set, const MatrixXd& A, const MatrixXd& metric) {
  const reference::ShapeInfo& shape = reference::info(set.shape);
  std::vector<double> lengths;
  for (const auto& edge : shape.edges) {
    Eigen::VectorXd e(set.dimension);
    for (int k = 0; k < set.dimension; ++k)
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
    for (const CellSet& set : problem.sets)
      for (std::int32_t cell = 0; cell < set.count; ++cell)
        for (int q = 0; q < set.points; q += 7)
          check(set, cell, q, target_at(set, cell, q, diagonal), straight_at(mesh, set, cell, q));
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
  for_each_target(mesh, options, [&](const CellSet& set, int, int, const MatrixXd& A, const MatrixXd& L) {
    const auto lengths = edge_lengths(set, A, MatrixXd::Identity(A.rows(), A.rows()));
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
  for_each_target(mesh, options, [&](const CellSet& set, int, int, const MatrixXd& A, const MatrixXd&) {
    for (const double length : edge_lengths(set, A, MatrixXd::Identity(A.rows(), A.rows())))
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
  for_each_target(mesh, options, [&](const CellSet& set, int, int, const MatrixXd& A, const MatrixXd&) {
    for (const double length : edge_lengths(set, A, metric)) EXPECT_NEAR(length, 1, 1e-12);
  });
}

TEST_P(Targets, SizesAtVerticesAreInterpolatedLinearly) {
  Options options;
  options.target = Target::Size;
  options.target_field.per = Per::Vertex;
  const HighOrderMesh mesh = testing::grid(GetParam(), {2, 2, 2}, 2);
  const auto size = [](double x, double y) { return 0.3 + 0.1 * x - 0.2 * y; };
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    options.target_field.values.push_back(size(mesh.coordinates[3 * n], mesh.coordinates[3 * n + 1]));
  const Problem problem = make_problem(mesh, options);
  const double diagonal = frame_of(mesh).diagonal;
  for (const CellSet& set : problem.sets) {
    const auto rule = reference::quadrature(set.shape, set.order, set.degree);
    const MatrixXd values =
        reference::basis_values(set.shape, 1, reference::NodeSet::Equispaced, set.dimension, rule.points);
    for (std::int32_t cell = 0; cell < set.count; ++cell)
      for (int q = 0; q < set.points; ++q) {
        double x = 0, y = 0;
        for (int v = 0; v < values.cols(); ++v) {
          const auto node = std::size_t(set.nodes[std::size_t(cell * set.nodes_per_cell + v)]);
          x += values(q, v) * mesh.coordinates[3 * node];
          y += values(q, v) * mesh.coordinates[3 * node + 1];
        }
        const MatrixXd A = target_at(set, cell, q, diagonal);
        EXPECT_NEAR(edge_lengths(set, A, MatrixXd::Identity(A.rows(), A.rows()))[0], size(x, y), 1e-12);
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
  for_each_target(mesh, options, [&](const CellSet& set, int cell, int, const MatrixXd& A, const MatrixXd& L) {
    const bool is_heated = set.shape == mesh.blocks[0].shape && cell == 0;
    EXPECT_LT((A - (is_heated ? 1.25 : 1.0) * L).norm(), 1e-13);
  });
}

// A rotated regular cell is its own ideal cell. This holds only if its rotation is found.
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

TEST(LevelTargets, KeepShapeAndMeasure) {
  const HighOrderMesh mesh = testing::read_case("annulus_p3.msh");
  Problem problem = build_problem(mesh, fixed_nodes(mesh), 0);
  problem.positions = solver_positions(mesh, frame_of(mesh));
  set_straight_sided_targets(problem);
  Problem level = problem;
  level_targets(level);
  const CellSet &before = problem.sets[0], &after = level.sets[0];
  ASSERT_FALSE(before.affine);
  bool uneven = false;
  for (std::int32_t cell = 0; cell < before.count; ++cell) {
    double measure = 0, level_measure = 0, first = 0;
    for (int q = 0; q < before.points; ++q) {
      const auto entry = [&](const CellSet& set, int k) { return set.inverse_target_of(cell)[k * set.stride + q]; };
      const auto determinant = [&](const CellSet& set) {
        return entry(set, 0) * entry(set, 3) - entry(set, 1) * entry(set, 2);
      };
      if (q == 0) first = determinant(after);
      EXPECT_NEAR(determinant(after), first, 1e-12 * std::abs(first));
      uneven = uneven || std::abs(determinant(before) - first) > 1e-3 * std::abs(first);
      const double scale = std::sqrt(determinant(after) / determinant(before));
      for (int k = 0; k < 4; ++k) EXPECT_NEAR(entry(after, k), scale * entry(before, k), 1e-12 * std::abs(first));
      const std::size_t at = static_cast<std::size_t>(cell) * before.stride + q;
      measure += before.measure[at];
      level_measure += after.measure[at];
    }
    EXPECT_NEAR(level_measure, measure, 1e-12 * measure);
  }
  EXPECT_TRUE(uneven);
}

}  // namespace
}  // namespace varimesh
