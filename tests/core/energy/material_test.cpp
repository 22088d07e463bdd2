// Which constants an energy gets.
#include "core/energy/material.h"

#include <gtest/gtest.h>

#include "tests/core/support/print.h"

namespace varimesh {
namespace {

Options with(Energy energy, Constants constants) {
  Options options;
  options.energy = energy;
  options.constants = constants;
  return options;
}

constexpr Energy kEnergies[] = {Energy::Hyperelastic, Energy::LinearElastic, Energy::Winslow, Energy::Distortion};

TEST(Material, HasTheReferenceConstantsOfPoissonsRatioTwoFifths) {
  for (const Energy energy : kEnergies) {
    const Material m = material(with(energy, Constants::Reference));
    EXPECT_DOUBLE_EQ(m.mu, 1 / (2 * 1.4));
    EXPECT_DOUBLE_EQ(m.lambda, 1 / (3 * 0.2));
    EXPECT_DOUBLE_EQ(m.kappa, 1 / (3 * 0.2));
  }
}

TEST(Material, HasAnotherLambdaForTheHyperelasticEnergyByDefault) {
  EXPECT_EQ(Options{}.constants, Constants::Standard);
  for (const Energy energy : kEnergies) {
    const Material m = material(with(energy, Constants::Standard)),
                   reference = material(with(energy, Constants::Reference));
    EXPECT_EQ(m.lambda, energy == Energy::Hyperelastic ? 10 : reference.lambda) << ::testing::PrintToString(energy);
    EXPECT_EQ(m.mu, reference.mu);
    EXPECT_EQ(m.kappa, reference.kappa);
  }
}

TEST(Material, TakesTheConstantsThatAreGiven) {
  for (const Constants constants : {Constants::Reference, Constants::Standard}) {
    Options options = with(Energy::Hyperelastic, constants);
    options.mu = 2;
    options.lambda = 3;
    options.kappa = 5;
    const Material m = material(options);
    EXPECT_EQ(m.mu, 2);
    EXPECT_EQ(m.lambda, 3);
    EXPECT_EQ(m.kappa, 5);
  }
}

TEST(Material, HasTheFormsAskedFor) {
  Options options = with(Energy::LinearElastic, Constants::Standard);
  options.strain = Strain::Small;
  options.volumetric = Volumetric::Trace;
  options.winslow = Winslow::Paper;
  const Material m = material(options);
  EXPECT_EQ(m.energy, Energy::LinearElastic);
  EXPECT_EQ(m.strain, Strain::Small);
  EXPECT_EQ(m.volumetric, Volumetric::Trace);
  EXPECT_EQ(m.winslow, Winslow::Paper);
}

TEST(EnergyName, IsTheFlagsWord) {
  EXPECT_EQ(name(Energy::Hyperelastic), "hyperelastic");
  EXPECT_EQ(name(Energy::LinearElastic), "linear-elastic");
  EXPECT_EQ(name(Energy::Winslow), "winslow");
  EXPECT_EQ(name(Energy::Distortion), "distortion");
}

}  // namespace
}  // namespace varimesh
