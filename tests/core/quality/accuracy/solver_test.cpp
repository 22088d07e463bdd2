// The loss of accuracy against the error of a solver.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "core/optimise/optimiser.h"
#include "core/quality/accuracy/accuracy.h"
#include "tests/core/quality/accuracy/plain_poisson.h"
#include "tests/core/support/cases.h"

namespace varimesh {
namespace {

using testing::PlainPoisson;
using testing::SolverErrors;

TEST(PlainPoisson, AgreesWithDolfinx) {
  // From tests/bench/solve/poisson.py with DOLFINx 0.5.2. The quadrature rules differ, and the integrands are no
  // polynomials, hence the tolerance.
  struct Case {
    const char* mesh;
    SolverErrors dolfinx;
  };
  for (const auto& [mesh, dolfinx] :
       {Case{"solid_ball_p3.msh", {4.05780664e-3, 6.17413787e-2}}, Case{"disc_p4.msh", {6.45950257e-5, 2.32584169e-3}},
        Case{"annulus_p3.msh", {2.61442035e-4, 3.29488888e-3}}}) {
    const HighOrderMesh read = testing::read_case(mesh);
    const SolverErrors found = PlainPoisson(read).errors();
    EXPECT_NEAR(found.in_value, dolfinx.in_value, 1e-4 * dolfinx.in_value) << mesh;
    EXPECT_NEAR(found.in_gradient, dolfinx.in_gradient, 1e-4 * dolfinx.in_gradient) << mesh;
  }
}

std::vector<double> ranks(const std::vector<double>& values) {
  std::vector<double> ranks;
  for (const double value : values)
    ranks.push_back(static_cast<double>(std::ranges::count_if(values, [&](double other) { return other < value; })));
  return ranks;
}

/// Spearman's rank correlation.
double correlation(const std::vector<double>& a, const std::vector<double>& b) {
  const std::vector<double> first = ranks(a), second = ranks(b);
  const auto n = static_cast<double>(a.size());
  double squares = 0;
  for (std::size_t i = 0; i < a.size(); ++i) squares += (first[i] - second[i]) * (first[i] - second[i]);
  return 1 - 6 * squares / (n * (n * n - 1));
}

TEST(Accuracy, RanksResultsAsTheErrorOfASolverDoes) {
  for (const char* name : {"sphere_p3.msh", "disc_p4.msh", "annulus_p3.msh"}) {
    const HighOrderMesh start = testing::read_case(name);
    std::vector<Options> choices(4);
    choices[0].energy = Energy::Distortion;
    choices[1].constants = Constants::Reference;
    choices[2].lambda = 100;
    choices[3].objective = Objective::Worst;
    std::vector<HighOrderMesh> results;
    if (quality(start).invalid_elements == 0) results.push_back(start);
    for (const Options& options : choices) {
      auto result = optimise(start, options);
      ASSERT_TRUE(result) << result.error().sentence;
      ASSERT_EQ(result->after.invalid_elements, 0) << name;
      results.push_back(std::move(result->mesh));
    }
    std::vector<double> losses, errors;
    for (const HighOrderMesh& mesh : results) {
      losses.push_back(accuracy(mesh).loss);
      errors.push_back(PlainPoisson(mesh).errors().in_gradient);
    }
    EXPECT_GE(correlation(losses, errors), 0.9) << name;
  }
}

}  // namespace
}  // namespace varimesh
