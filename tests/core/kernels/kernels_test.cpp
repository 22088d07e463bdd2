// The vectorised kernels against the plain ones, and the whole mesh's derivatives against differences of its energy,
// for every energy and every shape.
#include "core/kernels/kernels.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "core/hessian/batches.h"
#include "core/kernels/node_star.h"
#include "core/newton/newton.h"
#include "core/problem/target_field.h"
#include "core/problem/targets.h"
#include "core/sweeps/sweep.h"
#include "tests/core/energy/materials.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;
using testing::make_problem;

struct Case {
  NamedMaterial material;
  Filling filling;
};

std::vector<Case> every_case() {
  std::vector<Case> cases;
  for (const NamedMaterial& material : every_material())
    for (const Filling filling : {Filling::Triangles, Filling::MixedPlane, Filling::Tetrahedra, Filling::MixedSolid})
      cases.push_back({material, filling});
  return cases;
}

struct Way {
  bool tangled, metric;
};
constexpr Way kWays[] = {{false, false}, {true, false}, {false, true}, {true, true}};

/// Of the first of `stride` matrices d × d, entry by entry.
double determinant(const double* F, int d, int stride) {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
  for (int i = 0; i < d; ++i)
    for (int j = 0; j < d; ++j) matrix(i, j) = F[(i * d + j) * stride];
  return matrix.determinant();
}

class KernelsTest : public ::testing::TestWithParam<Case> {
 protected:
  /// `tangled`: shaken so much that some cells are invalid. `metric`: the target has one, with axes across the grid's.
  void prepare(bool tangled, bool metric = false) {
    const bool plane = testing::is_plane(GetParam().filling);
    HighOrderMesh mesh = testing::grid(GetParam().filling, {3, 2, 2}, 3, testing::bent(plane ? 2 : 3));
    testing::shake(mesh, tangled ? 0.12 : 0.01, 7);
    problem_ = make_problem(mesh);
    mesh_ = std::move(mesh);
    if (metric) set_target(Target::Size, metric_field());
    fast_ = make_kernels(GetParam().material.material, problem_.dimension);
    plain_ = make_plain_kernels(GetParam().material.material, problem_.dimension);
    sweeper_.emplace(problem_, coloured_, *plain_, Regularisation::Element, PNorm{}, -1.0, team_);
    sweeper_->rebuild();
    invalid_ = sweeper_->scan().invalid;
  }

  void set_target(Target target, TargetField values) {
    Options options;
    options.target = target;
    options.target_field = std::move(values);
    const auto field = resolve_target_field(mesh_, options);
    ASSERT_TRUE(field) << field.error().sentence;
    set_targets(problem_, *field, frame_of(mesh_).diagonal);
  }

  /// Edges of about 0.3 with a ratio of 4 and more, finer from left to right.
  TargetField metric_field() const {
    TargetField field{Per::Vertex, mesh_.dimension == 2 ? 3 : 6, {}, {}};
    for (std::size_t n = 0; n < mesh_.node_count(); ++n) {
      const double fineness = 1 + 0.5 * mesh_.coordinates[3 * n];
      for (const double entry : {8.0, 11.0, 40.0, -3.0, 9.0, 14.0})
        if (field.values.size() < (n + 1) * std::size_t(field.components)) field.values.push_back(fineness * entry);
    }
    return field;
  }

  HighOrderMesh mesh_;
  Problem problem_;
  ColouredNodes coloured_;
  Team team_{1};
  std::unique_ptr<Kernels> fast_, plain_;
  std::optional<Sweeper> sweeper_;
  std::int64_t invalid_ = 0;
};

TEST_P(KernelsTest, ExpandAPatchLikeThePlainOnes) {
  for (const auto [tangled, metric] : kWays) {
    prepare(tangled, metric);
    ASSERT_EQ(invalid_ > 0, tangled);
    for (std::int32_t rank = 0; rank < std::int32_t(problem_.free.size()); rank += 3) {
      NodeStar star(problem_, rank);
      const StarExpansion a = fast_->expand(star.cells()), b = plain_->expand(star.cells());
      double gradient = 0, hessian = 0;
      for (const double g : b.gradient) gradient = std::max(gradient, std::abs(g));
      for (const double h : b.hessian) hessian = std::max(hessian, std::abs(h));
      EXPECT_NEAR(a.energy, b.energy, 1e-11 * (std::abs(b.energy) + b.measure));
      EXPECT_NEAR(a.measure, b.measure, 1e-13 * b.measure);
      // A gradient is a sum of much larger terms of both signs; h is what they scale with.
      for (int i = 0; i < 3; ++i) EXPECT_NEAR(a.gradient[i], b.gradient[i], 1e-10 * (gradient + 0.01 * hessian));
      for (int i = 0; i < 6; ++i) EXPECT_NEAR(a.hessian[i], b.hessian[i], 1e-10 * hessian);
    }
  }
}

TEST_P(KernelsTest, TryAndTakeAStepLikeThePlainOnes) {
  for (const auto [tangled, metric] : kWays) {
    prepare(tangled, metric);
    Problem copy = problem_;
    const double step[3] = {0.004, -0.003, 0.002};
    AlignedVector<double> lines(NodeStar::kMostNumbers);
    for (std::int32_t rank = 0; rank < std::int32_t(problem_.free.size()); rank += 5) {
      const int line_size = rank % 2 == 0 ? fast_->line_size() : 0;  // with what an expansion leaves, and without
      NodeStar fast_patch(problem_, rank, line_size, lines.data()), plain_patch(copy, rank);
      EXPECT_EQ(fast_patch.cells()[0].line != nullptr, line_size > 0);
      if (rank % 4 == 0) fast_patch.cells()[0].line = nullptr;  // where there is no room for all
      if (line_size > 0) fast_->expand(fast_patch.cells());
      const double a = fast_->energy_after(fast_patch.cells(), step),
                   b = plain_->energy_after(plain_patch.cells(), step);
      if (std::isinf(b))
        EXPECT_EQ(a, b);
      else
        EXPECT_NEAR(a, b, 1e-11 * (std::abs(b) + 1));
      EXPECT_NEAR(fast_->smallest_jacobian(fast_patch.cells()), plain_->smallest_jacobian(plain_patch.cells()), 1e-12);
      fast_->move(fast_patch.cells(), step);
      plain_->move(plain_patch.cells(), step);
    }
    for (std::size_t set = 0; set < copy.sets.size(); ++set)
      for (std::size_t i = 0; i < copy.sets[set].deformation.size(); ++i)
        ASSERT_NEAR(problem_.sets[set].deformation[i], copy.sets[set].deformation[i], 1e-12);
  }
}

TEST_P(KernelsTest, KeepTheEnergysFunctionOfJBesideF) {
  for (const auto [tangled, metric] : kWays) {
    prepare(tangled, metric);
    drop_deformation(problem_);
    EXPECT_TRUE(hold_deformation(problem_, fast_->keeps_function()));
    for (CellSet& set : problem_.sets)
      for (std::int32_t cell = 0; cell < set.count; ++cell) fast_->rebuild(set, cell, problem_.positions);
    const double step[3] = {0.004, -0.003, 0.002}, other[3] = {0.001, 0.002, -0.002};
    AlignedVector<double> lines(NodeStar::kMostNumbers);
    for (std::int32_t rank = 0; rank < std::int32_t(problem_.free.size()); ++rank) {
      // With what an expansion leaves, without it, and where a whole star has one δ.
      NodeStar star(problem_, rank, rank % 3 == 0 ? fast_->line_size() : 0, lines.data()), anew(problem_, rank);
      for (StarCell& cell : anew.cells()) cell.jacobian_function = nullptr;
      if (std::isinf(fast_->energy_after(anew.cells(), step))) continue;  // no sweep would make it
      if (rank % 3 == 1)
        for (NodeStar* each : {&star, &anew})
          for (StarCell& cell : each->cells()) cell.delta_squared = 1e-3;
      const StarExpansion a = fast_->expand(star.cells()), b = fast_->expand(anew.cells());
      EXPECT_NEAR(a.energy, b.energy, 1e-11 * (std::abs(b.energy) + b.measure));
      for (int i = 0; i < 6; ++i) EXPECT_NEAR(a.hessian[i], b.hessian[i], 1e-11 * std::abs(b.hessian[0]));
      fast_->energy_after(star.cells(), other);  // turned down
      fast_->energy_after(star.cells(), step);
      fast_->move(star.cells(), step);
    }
    AlignedVector<double> expected;
    for (CellSet& set : problem_.sets) {
      EXPECT_EQ(set.jacobian_function.empty(), !fast_->keeps_function());
      if (!fast_->keeps_function()) continue;
      expected.resize(set.stride);
      for (std::int32_t cell = 0; cell < set.count; ++cell) {
        const double* F = set.deformation_of(cell);
        fast_->take_function(F, set.stride, expected.data());
        for (int q = 0; q < set.stride; ++q) {
          if (!(determinant(F + q, set.dimension, set.stride) > 0)) continue;
          ASSERT_NEAR(set.jacobian_function_of(cell)[q], expected[q], 1e-10 * (1 + std::abs(expected[q])));
        }
        const CellScan kept = fast_->scan_kept(set, cell), anew = fast_->scan(set, cell, F, nullptr);
        EXPECT_NEAR(kept.energy, anew.energy, 1e-10 * (std::abs(anew.energy) + 1e-3));
      }
    }
  }
}

TEST_P(KernelsTest, ReadOneMatrixWhereTheTargetsOfACellAreAlike) {
  const auto mesh = [](double shear, double taper) {
    return testing::grid(GetParam().filling, {3, 2, 2}, 2, [=](testing::Place at) {
      const auto [x, y, z] = at;
      return testing::Place{x + shear * y + taper * x * (y + z), y, z * (1 + taper * y)};
    });
  };
  problem_ = make_problem(mesh(0.3, 0.1));
  for (const CellSet& set : problem_.sets)
    for (std::int32_t cell = 0; cell < set.count; ++cell) EXPECT_EQ(set.uniform_target_of(cell), nullptr);
  problem_ = make_problem(mesh(0.3, 0));
  fast_ = make_kernels(GetParam().material.material, problem_.dimension);
  hold_deformation(problem_, false);
  for (CellSet& set : problem_.sets)
    for (std::int32_t cell = 0; cell < set.count; ++cell) {
      EXPECT_EQ(set.uniform_target_of(cell) == nullptr, set.affine);
      fast_->rebuild(set, cell, problem_.positions);
    }
  Problem copy = problem_;
  for (CellSet& set : copy.sets) set.uniform_target.clear();
  const double step[3] = {0.004, -0.003, 0.002};
  for (std::int32_t rank = 0; rank < std::int32_t(problem_.free.size()); ++rank) {
    NodeStar one(problem_, rank), many(copy, rank);
    const StarExpansion a = fast_->expand(one.cells()), b = fast_->expand(many.cells());
    EXPECT_NEAR(a.measure, b.measure, 1e-13 * b.measure);
    for (int i = 0; i < 6; ++i) EXPECT_NEAR(a.hessian[i], b.hessian[i], 1e-11 * b.hessian[0]);
    EXPECT_NEAR(fast_->energy_after(one.cells(), step), fast_->energy_after(many.cells(), step), 1e-12);
  }
}

TEST_P(KernelsTest, RebuildAndScanLikeThePlainOnes) {
  for (const bool metric : {false, true}) {
    prepare(true, metric);
    for (CellSet& set : problem_.sets)
      for (std::int32_t cell = 0; cell < set.count; ++cell) {
        const CellScan b = plain_->scan_kept(set, cell);
        fast_->rebuild(set, cell, problem_.positions);
        const CellScan a = fast_->scan_kept(set, cell);
        EXPECT_NEAR(a.energy, b.energy, 1e-10 * (std::abs(b.energy) + 1e-3));
        EXPECT_NEAR(a.smallest_jacobian, b.smallest_jacobian, 1e-12);
        EXPECT_NEAR(a.scaled_jacobian, b.scaled_jacobian, 1e-12);
      }
  }
}

TEST_P(KernelsTest, TheMeshsDerivativesMatchDifferencesOfItsEnergy) {
  for (const auto [tangled, metric] : kWays)
    for (const Target target : {Target::StraightSided, Target::Ideal, Target::Size, Target::Strain}) {
      if (metric && target != Target::Size) continue;
      prepare(tangled, metric);
      TargetField values;
      if (target == Target::Size || target == Target::Strain)
        values.values.assign(mesh_.element_count(mesh_.dimension), target == Target::Size ? 0.4 : 0.1);
      if (!metric) set_target(target, values);
      sweeper_->rebuild();
      sweeper_->scan();
      testing::WholeMesh whole(problem_, *plain_);
      const std::vector<double> direction = testing::random_direction(problem_, 11);
      const double h = 1e-5;
      const double difference = (8 * (whole.energy(direction, h) - whole.energy(direction, -h)) -
                                 (whole.energy(direction, 2 * h) - whole.energy(direction, -2 * h))) /
                                (12 * h);
      const std::vector<double> gradient = whole.gradient(*fast_);
      double slope = 0, size = 0;
      for (std::size_t i = 0; i < gradient.size(); ++i) {
        slope += gradient[i] * direction[i];
        size += std::abs(gradient[i] * direction[i]);
      }
      EXPECT_NEAR(slope, difference, 1e-6 * size)
          << "target " << static_cast<int>(target) << (metric ? ", metric" : "");
    }
}

TEST_P(KernelsTest, DeformationIsKeptTo16BitsOfItsDifferences) {
  for (const auto [tangled, metric] : kWays) {
    prepare(tangled, metric);
    const int d = problem_.dimension;
    const auto hessian = make_hessian_kernels(GetParam().material.material, d);
    for (BatchSet& set : make_batches(problem_, *hessian))
      for (std::int32_t cell = 0; cell < set.cells->count; ++cell) {
        const CellSet& cells = *set.cells;
        const std::int32_t b = cell / kBatch, lane = cell % kBatch;
        hessian->linearise(set, b, cells.deformation_of(b * kBatch));
        const float* mean = set.mean.data() + std::size_t(b) * (d * d + 1) * kBatch + lane;
        const std::int16_t* steps = set.deformation.data() + b * set.deformation_size() + lane;
        const double step = mean[d * d * kBatch];
        double largest = 0;
        for (int entry = 0; entry < d * d; ++entry)
          for (int q = 0; q < cells.points; ++q) {
            const double F = cells.deformation_of(cell)[entry * cells.stride + q], middle = mean[entry * kBatch];
            const double kept = middle + step * steps[(set.gradient.slots[q] * d * d + entry) * kBatch];
            EXPECT_LE(std::abs(kept - F), 0.5001 * step);
            largest = std::max(largest, std::abs(F - middle));
          }
        EXPECT_NEAR(step * 32767, largest, 1e-6 * largest);
      }
  }
}

// A node's gradient and its own set of the Hessian, cell by cell as Newton's method takes them.
//
// What is made of F to 16 bits of what it differs by from its mean: 1.5e-5 of that, times the energy's third
// derivatives over its second; where the mesh is tangled J is next to nothing in places, and they are steep.
TEST_P(KernelsTest, CellsPartsAddUpToTheirNodesExpansions) {
  for (const auto [tangled, metric] : kWays) {
    prepare(tangled, metric);
    const int d = problem_.dimension;
    const auto hessian = make_hessian_kernels(GetParam().material.material, d);
    std::vector<BatchSet> batches = make_batches(problem_, *hessian);
    std::vector<StarExpansion> sums(problem_.free.size());
    const auto add_up = [&](auto add) {
      for (std::size_t rank = 0; rank < sums.size(); ++rank)
        for (std::int32_t i = problem_.offsets[rank]; i < problem_.offsets[rank + 1]; ++i) {
          const Incidence& at = problem_.incidences[i];
          const BatchSet& set = batches[at.set];
          add(sums[rank], set.contributions.data() + set.contribution_index(at.cell, at.local, 2 * d));
        }
    };
    for (BatchSet& set : batches)
      for (std::int32_t b = 0; b < set.count; ++b) hessian->linearise(set, b, set.cells->deformation_of(b * kBatch));
    add_up([d](StarExpansion& sum, const float* part) {
      for (int k = 0; k < d; ++k) sum.gradient[k] += double(part[k]) + part[d + k];
    });
    for (BatchSet& set : batches)
      for (std::int32_t b = 0; b < set.count; ++b) hessian->node_blocks(set, b);
    add_up([d](StarExpansion& sum, const float* part) {
      for (int entry = 0; entry < d * (d + 1) / 2; ++entry) sum.hessian[entry] += part[entry];
    });
    for (std::size_t rank = 0; rank < sums.size(); ++rank) {
      const StarExpansion plain = plain_->expand(NodeStar(problem_, std::int32_t(rank)).cells());
      double gradient = 0, size = 0;
      for (const double g : plain.gradient) gradient = std::max(gradient, std::abs(g));
      for (const double h : plain.hessian) size = std::max(size, std::abs(h));
      for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(sums[rank].gradient[i], plain.gradient[i], 1e-10 * (gradient + 0.01 * size));
      for (int i = 0; i < 6; ++i)
        EXPECT_NEAR(sums[rank].hessian[i], plain.hessian[i], (tangled ? 2.5e-3 : 4e-5) * size);
    }
  }
}

TEST_P(KernelsTest, ProductsMatchDifferencesOfTheGradient) {
  for (const auto [tangled, metric] : kWays) {
    prepare(tangled, metric);
    testing::WholeMesh whole(problem_, *plain_);
    const std::vector<double> direction = testing::random_direction(problem_, 13);
    const double h = 1e-5;
    std::vector<double> expected(direction.size());
    for (const auto& [steps, weight] : {std::pair{1, 8.0}, {-1, -8.0}, {2, -1.0}, {-2, 1.0}}) {
      const std::vector<double> g = whole.gradient_at(direction, steps * h, *fast_);
      for (std::size_t i = 0; i < g.size(); ++i) expected[i] += weight * g[i] / (12 * h);
    }
    const auto hessian = make_hessian_kernels(GetParam().material.material, problem_.dimension);
    const std::vector<double> product = whole.product(*hessian, direction);
    double error = 0, size = 0;
    for (std::size_t i = 0; i < product.size(); ++i) {
      error += std::pow(product[i] - expected[i], 2);
      size += std::pow(expected[i], 2);
    }
    EXPECT_LE(std::sqrt(error / size), tangled ? 4e-4 : 2e-5);
  }
}

TEST(Products, DoNotDependOnWhatTheThreadDidBefore) {
  const auto product = [](int order, double size) {
    Problem problem = make_problem(testing::grid(Filling::Tetrahedra, {2, 2, 2}, order));
    const auto plain = make_plain_kernels(material(Options{}), 3);
    hold_deformation(problem, false);
    for (CellSet& set : problem.sets)
      for (std::int32_t cell = 0; cell < set.count; ++cell) plain->rebuild(set, cell, problem.positions);
    std::vector<double> direction = testing::random_direction(problem, 3);
    for (double& number : direction) number *= size;
    testing::WholeMesh whole(problem, *plain);
    return whole.product(*make_hessian_kernels(material(Options{}), 3), direction);
  };
  const std::vector<double> first = product(1, 1);
  product(4, 1e6);
  EXPECT_EQ(product(1, 1), first);
}

INSTANTIATE_TEST_SUITE_P(All, KernelsTest, ::testing::ValuesIn(every_case()),
                         [](const auto& info) { return info.param.material.name + testing::name(info.param.filling); });

}  // namespace
}  // namespace varimesh
