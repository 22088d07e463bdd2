// The part of the preconditioner for stretched cells: against plain inverses, and what it saves.
#include "core/preconditioner/stretched_cells.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <random>

#include "core/energy/material.h"
#include "core/preconditioner/preconditioner.h"
#include "core/solvers/conjugate_gradients.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::Place;

/// A mesh of straight-sided cells as they should be, so that the mean tensors give the Hessian itself.
class StretchedCellsOn {
 public:
  StretchedCellsOn(Filling filling, std::array<int, 3> counts, int order, const testing::Map& map)
      : problem_(testing::make_problem(testing::grid(filling, counts, order, map))),
        hessian_(make_hessian_kernels(material(Options{}), problem_.dimension)),
        kernels_(make_kernels(material(Options{}), problem_.dimension)) {
    hold_deformation(problem_, false);
    for (CellSet& set : problem_.sets)
      for (std::int32_t cell = 0; cell < set.count; ++cell) kernels_->rebuild(set, cell, problem_.positions);
    batches_ = make_batches(problem_, *hessian_);
    for (BatchSet& set : batches_)
      for (std::int32_t b = 0; b < set.count; ++b) hessian_->linearise(set, b, set.cells->deformation_of(b * kBatch));
    for (const BatchSet& set : batches_) {
      tensors_.emplace_back(std::size_t(set.cells->count) * std::size_t(tensor_size(problem_.dimension)));
      for (std::int32_t b = 0; b < set.count; ++b) hessian_->mean_tensors(set, b, tensors_.back());
    }
  }

  std::size_t unknowns() const { return problem_.free.size() * std::size_t(problem_.dimension); }

  std::vector<float> random_vector(unsigned seed) const {
    std::mt19937 random(seed);
    std::vector<float> vector(unknowns());
    for (float& x : vector) x = 2 * float(random()) / float(std::mt19937::max()) - 1;
    return vector;
  }

  /// H times a vector, which has padded(d) zeros more at its end.
  std::vector<float> multiply(const std::vector<float>& x) {
    for (BatchSet& set : batches_)
      for (std::int32_t b = 0; b < set.count; ++b) hessian_->apply(set, b, x);
    std::vector<float> product(x.size());
    hessian_->add_up(problem_, batches_, x.data(), product.data(), 0, std::int32_t(problem_.free.size()));
    return product;
  }

  /// S r, its product with r, and the groups, if this many cells may count.
  struct Added {
    std::vector<float> z;
    double along = 0;
    std::vector<std::vector<std::int32_t>> groups;
  };
  Added add(const std::vector<float>& r, std::int32_t most_cells, int threads = 1) const {
    const Team team(threads);
    Added added;
    added.z.assign(r.size(), 0);
    team.run([&] {
      StretchedCells cells(problem_, batches_, most_cells, team);
      cells.assemble(tensors_);
      added.along = cells.add(r, added.z);
      added.groups = cells.groups();
    });
    return added;
  }

  Problem problem_;
  std::unique_ptr<HessianKernels> hessian_;
  std::unique_ptr<Kernels> kernels_;
  std::vector<BatchSet> batches_;
  std::vector<std::vector<float>> tensors_;
};

/// The third of four layers of cells in x is thin.
Place with_thin_layer(Place at) {
  constexpr double kThickness = 0.02;
  if (at[0] > 0.75)
    at[0] = 1 - (1 - at[0]) / 0.25 * (0.5 - kThickness);
  else if (at[0] > 0.5)
    at[0] = 0.5 + (at[0] - 0.5) / 0.25 * kThickness;
  return at;
}

/// In one of eleven of the 125 cubes, the centre is close to a side.
Place with_flat_cells(Place at) {
  const auto cube = [](double x) { return int(std::floor(5 * x)); };
  const auto is_centre = [](double x) { return std::abs(5 * x - std::floor(5 * x) - 0.5) < 1e-6; };
  if (!is_centre(at[0]) || !is_centre(at[1]) || !is_centre(at[2])) return at;
  if ((cube(at[0]) + 2 * cube(at[1]) + 3 * cube(at[2])) % 11 == 0) at[0] -= 0.097;
  return at;
}

class EachFilling : public ::testing::TestWithParam<Filling> {};

INSTANTIATE_TEST_SUITE_P(Fillings, EachFilling, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& info) { return testing::name(info.param); });

/// The Hessian's rows and columns of these nodes.
Eigen::MatrixXd hessian_of(StretchedCellsOn& mesh, const std::vector<std::int32_t>& nodes) {
  const auto d = std::size_t(mesh.problem_.dimension);
  const auto index = [&](std::size_t i) { return std::size_t(nodes[i / d]) * d + i % d; };
  Eigen::MatrixXd H(Eigen::Index(nodes.size() * d), Eigen::Index(nodes.size() * d));
  for (std::size_t column = 0; column < nodes.size() * d; ++column) {
    std::vector<float> unit(mesh.unknowns() + std::size_t(padded(mesh.problem_.dimension)));
    unit[index(column)] = 1;
    const std::vector<float> product = mesh.multiply(unit);
    for (std::size_t row = 0; row < nodes.size() * d; ++row)
      H(Eigen::Index(row), Eigen::Index(column)) = product[index(row)];
  }
  return H;
}

TEST_P(EachFilling, AddsTheInversesOfTheGroupsHessians) {
  StretchedCellsOn mesh(GetParam(), {4, 3, 3}, 3, with_thin_layer);
  const auto d = std::size_t(mesh.problem_.dimension);
  const std::vector<float> r = mesh.random_vector(1);
  const auto added = mesh.add(r, mesh.problem_.cells);
  ASSERT_FALSE(added.groups.empty());
  std::vector<int> count(mesh.problem_.free.size());
  for (const auto& group : added.groups)
    for (const std::int32_t node : group) ++count[std::size_t(node)];
  Eigen::VectorXd expected = Eigen::VectorXd::Zero(Eigen::Index(mesh.unknowns()));
  for (const auto& group : added.groups) {
    Eigen::MatrixXd H = hessian_of(mesh, group);
    H.diagonal() *= 1 + 1e-6;
    Eigen::VectorXd right(H.rows());
    const auto index = [&](Eigen::Index i) { return std::size_t(group[std::size_t(i) / d]) * d + std::size_t(i) % d; };
    const auto weight = [&](Eigen::Index i) { return 1 / std::sqrt(double(count[index(i) / d])); };
    for (Eigen::Index i = 0; i < H.rows(); ++i) right[i] = weight(i) * r[index(i)];
    const Eigen::VectorXd solution = H.ldlt().solve(right);
    for (Eigen::Index i = 0; i < H.rows(); ++i) expected[Eigen::Index(index(i))] += weight(i) * solution[i];
  }
  Eigen::VectorXd z(expected.size());
  double along = 0;
  for (std::size_t i = 0; i < r.size(); ++i) along += double(r[i]) * (z[Eigen::Index(i)] = added.z[i]);
  EXPECT_LT((z - expected).norm(), 0.02 * expected.norm());
  EXPECT_NEAR(added.along, along, 1e-4 * added.along);
}

TEST_P(EachFilling, CountsNoCellIfTooManyAreStretched) {
  const StretchedCellsOn mesh(GetParam(), {4, 3, 3}, 3, with_thin_layer);
  EXPECT_TRUE(mesh.add(mesh.random_vector(1), 1).groups.empty());
}

TEST_P(EachFilling, GivesTheSameBitsOnAnyNumberOfThreads) {
  const StretchedCellsOn mesh(GetParam(), {4, 3, 3}, 3, with_thin_layer);
  const std::vector<float> r = mesh.random_vector(2);
  const auto one = mesh.add(r, mesh.problem_.cells), four = mesh.add(r, mesh.problem_.cells, 4);
  EXPECT_FALSE(one.groups.empty());
  EXPECT_EQ(one.z, four.z);
  EXPECT_EQ(one.along, four.along);
}

TEST_P(EachFilling, FindsNothingInAMeshWithoutStretchedCells) {
  const StretchedCellsOn mesh(GetParam(), {4, 3, 3}, 3, testing::bent(testing::is_plane(GetParam()) ? 2 : 3));
  const auto added = mesh.add(mesh.random_vector(3), mesh.problem_.cells);
  EXPECT_TRUE(added.groups.empty());
  EXPECT_EQ(added.z, std::vector<float>(mesh.unknowns(), 0.0F));
  EXPECT_EQ(added.along, 0);
}

TEST(StretchedCells, KeepsGroupsSmall) {
  const StretchedCellsOn mesh(Filling::Tetrahedra, {4, 4, 4}, 3, with_thin_layer);
  const auto groups = mesh.add(mesh.random_vector(4), mesh.problem_.cells).groups;
  ASSERT_GT(groups.size(), 1U);
  for (const auto& group : groups) {
    EXPECT_LE(group.size(), StretchedCells::kMostNodes);
    EXPECT_TRUE(std::ranges::is_sorted(group));
    EXPECT_EQ(std::ranges::adjacent_find(group), group.end());
  }
}

TEST(StretchedCells, LeavesOutMeshesWhoseCellsHaveTooManyNodes) {
  const StretchedCellsOn mesh(Filling::Hexahedra, {4, 2, 2}, 5, with_thin_layer);
  EXPECT_TRUE(mesh.add(mesh.random_vector(5), mesh.problem_.cells).groups.empty());
}

/// H x = r with the whole preconditioner, or with the stretched cells' part taken away from it.
struct System {
  StretchedCellsOn& mesh;
  Preconditioner& preconditioner;
  StretchedCells* taken_away;
  std::vector<float> r, z, p, Hp;
  double first = 0;

  double multiply() {
    Hp = mesh.multiply(p);
    double along = 0;
    for (std::size_t i = 0; i < mesh.unknowns(); ++i) along += double(p[i]) * Hp[i];
    return along;
  }
  void advance(double alpha) {
    for (std::size_t i = 0; i < r.size(); ++i) r[i] -= float(alpha) * Hp[i];
  }
  double precondition() {
    double along = preconditioner.apply(r, z);
    if (taken_away == nullptr) return along;
    std::vector<float> part(mesh.unknowns());
    along -= taken_away->add(r, part);
    for (std::size_t i = 0; i < part.size(); ++i) z[i] -= part[i];
    return along;
  }
  bool is_solved(double rz) const { return rz <= 1e-6 * first; }
  void turn(double beta) {
    for (std::size_t i = 0; i < mesh.unknowns(); ++i) p[i] = z[i] + float(beta) * p[i];
  }
};

int products(StretchedCellsOn& mesh, bool with_stretched) {
  const int d = mesh.problem_.dimension;
  const Team team(1);
  int count = 0;
  team.run([&] {
    Preconditioner preconditioner(mesh.problem_, mesh.batches_, team);
    preconditioner.assemble(*mesh.hessian_);
    StretchedCells stretched(mesh.problem_, mesh.batches_, StretchedCells::most_cells(mesh.problem_), team);
    stretched.assemble(mesh.tensors_);
    for (std::size_t rank = 0; rank < mesh.problem_.free.size(); ++rank) {
      const StarExpansion own = mesh.kernels_->expand(NodeStar(mesh.problem_, std::int32_t(rank)).cells());
      std::array<double, 6> block{};
      std::copy_n(own.hessian.begin(), triangle_size(d), block.begin());
      preconditioner.set_block(std::int32_t(rank), block);
    }
    System system{mesh, preconditioner, with_stretched ? nullptr : &stretched, mesh.random_vector(6), {}, {}, {}};
    system.r.resize(system.r.size() + std::size_t(padded(d)));
    system.z.resize(system.r.size());
    system.first = system.precondition();
    system.p = system.z;
    count = conjugate_gradients(system, system.first, 1000).products;
  });
  return count;
}

TEST(StretchedCells, SaveMostOfTheProductsThatFlatCellsCost) {
  StretchedCellsOn regular(Filling::Tetrahedra, {5, 5, 5}, 4, {});
  StretchedCellsOn flat(Filling::Tetrahedra, {5, 5, 5}, 4, with_flat_cells);
  const int without_flat = products(regular, true), with = products(flat, true), without = products(flat, false);
  EXPECT_GT(without, 2 * without_flat);
  EXPECT_LT(2 * (with - without_flat), without - without_flat);
  RecordProperty("products", std::to_string(without_flat) + " " + std::to_string(with) + " " + std::to_string(without));
}

}  // namespace
}  // namespace varimesh
