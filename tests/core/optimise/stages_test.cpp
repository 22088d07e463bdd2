// The energies that are minimised one after another.
#include "core/optimise/stages.h"

#include <gtest/gtest.h>

#include "core/energy/material.h"

namespace varimesh {
namespace {

TEST(MakeStages, OfTheEnergyIsOneWithTheOptionsAskedFor) {
  Options options;
  options.lambda = 3;
  options.p_norm = 5;
  options.tolerance = 1e-8;
  const std::vector<Stage> stages = make_stages(options, 3);
  ASSERT_EQ(stages.size(), 1U);
  EXPECT_EQ(stages[0].options.lambda, 3);
  EXPECT_EQ(stages[0].options.p_norm, 5);
  EXPECT_EQ(stages[0].options.tolerance, 1e-8);
  EXPECT_NE(stages[0].kernels, nullptr);
  EXPECT_NE(stages[0].hessian, nullptr);
}

TEST(MakeStages, LeavesOutTheHessianIfNoNewtonStepIsToCome) {
  Options options;
  options.method = Method::Sweeps;
  EXPECT_EQ(make_stages(options, 2)[0].hessian, nullptr);
  options.method = Method::Newton;
  EXPECT_NE(make_stages(options, 2)[0].hessian, nullptr);
}

TEST(MakeStages, HasTheBarrierOfTheDescentForAccuracy) {
  Options options;
  options.objective = Objective::Accuracy;
  options.method = Method::Sweeps;
  const std::vector<Stage> stages = make_stages(options, 2);
  ASSERT_EQ(stages.size(), 1U);
  EXPECT_NE(stages[0].hessian, nullptr) << "the barrier takes its gradient from it";
}

TEST(MakeStages, RaisesLambdaAndKappaForTheWorstCells) {
  for (const Energy energy : {Energy::Hyperelastic, Energy::LinearElastic}) {
    Options options;
    options.energy = energy;
    options.objective = Objective::Worst;
    const Material first = material(options);
    const std::vector<Stage> stages = make_stages(options, 3);
    ASSERT_EQ(stages.size(), 4U);
    EXPECT_EQ(stages[0].options.p_norm, 1) << "first the energy asked for";
    double factor = 1;
    for (std::size_t s = 1; s < stages.size(); ++s) {
      factor *= 4;
      EXPECT_DOUBLE_EQ(material(stages[s].options).lambda, factor * first.lambda);
      EXPECT_DOUBLE_EQ(material(stages[s].options).kappa, factor * first.kappa);
      EXPECT_DOUBLE_EQ(material(stages[s].options).mu, first.mu);
      EXPECT_EQ(stages[s].options.p_norm, 2);
    }
  }
}

TEST(MakeStages, HasOneMoreStageForEnergiesWithoutLambda) {
  for (const Energy energy : {Energy::Winslow, Energy::Distortion}) {
    Options options;
    options.energy = energy;
    options.objective = Objective::Worst;
    const std::vector<Stage> stages = make_stages(options, 2);
    ASSERT_EQ(stages.size(), 2U);
    EXPECT_EQ(stages[1].options.p_norm, 2);
  }
}

TEST(MakeStages, KeepsALargerPNorm) {
  Options options;
  options.objective = Objective::Worst;
  options.p_norm = 6;
  for (const Stage& stage : make_stages(options, 2)) EXPECT_EQ(stage.options.p_norm, 6);
}

}  // namespace
}  // namespace varimesh
