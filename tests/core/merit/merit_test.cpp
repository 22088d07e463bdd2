// The order of meshes: what is left comes first, and then what is asked for.
#include "core/merit/merit.h"

#include <gtest/gtest.h>

#include "core/merit/thresholds.h"

namespace varimesh {
namespace {

/// Only `a` is better than `b`.
void expect_order(const Merit& a, const Merit& b, const Asked& asked) {
  EXPECT_TRUE(is_better(a, b, asked));
  EXPECT_FALSE(is_better(b, a, asked));
}

void expect_equal(const Merit& a, const Merit& b, const Asked& asked) {
  EXPECT_FALSE(is_better(a, b, asked));
  EXPECT_FALSE(is_better(b, a, asked));
}

TEST(Merit, EveryMeshIsBetterThanNone) {
  for (const Asked::What what : {Asked::What::Validity, Asked::What::Minimum, Asked::What::Loss})
    expect_order({.uncertified = 1'000'000, .smallest = -1}, Merit::of_nothing(), {.what = what});
}

TEST(Merit, ALostCertificateIsWorseThanAnyNumberOfUncertifiedCells) {
  expect_order({.uncertified = 9, .smallest = -1}, {.lost = 1, .uncertified = 1, .smallest = 0.9}, kAskForMinimum);
}

TEST(Merit, FewerUncertifiedCellsComeBeforeWhatIsAskedFor) {
  for (const Asked::What what : {Asked::What::Validity, Asked::What::Minimum, Asked::What::Loss})
    expect_order({.uncertified = 1, .smallest = -1, .loss = 1}, {.uncertified = 2, .smallest = 0.9, .loss = 0},
                 {.what = what});
}

TEST(Merit, WeakCellsComeBeforeUncertifiedOnesIfTheyAreKnown) {
  expect_order({.uncertified = 3, .weak = 4}, {.uncertified = 2, .weak = 5}, kAskForMinimum);
  expect_order({.uncertified = 2, .weak = 4}, {.uncertified = 3, .weak = 4}, kAskForMinimum);
}

TEST(Merit, AMeshThatIsNotLowerThanItCameIsBetter) {
  expect_order({.loss = 2}, {.loss = 1, .lower_than_it_came = true}, {.what = Asked::What::Loss});
}

TEST(Merit, ValidityAsksForNothingElse) {
  expect_equal({.smallest = 0.1, .loss = 2}, {.smallest = 0.9, .loss = 1}, {.what = Asked::What::Validity});
}

TEST(Merit, TheHigherMinimumIsBetter) {
  expect_order({.smallest = 0.2, .mean = 0.5}, {.smallest = 0.1, .mean = 0.9}, kAskForMinimum);
  expect_equal({.smallest = 0.2, .mean = 0.5}, {.smallest = 0.2, .mean = 0.9}, kAskForMinimum);
}

// ===== the loss of accuracy =====

constexpr Asked kLoss{.what = Asked::What::Loss, .bound = 0.1};

TEST(MeritByLoss, AMeshThatReachesTheBoundIsBetter) {
  expect_order({.smallest = 0.1, .loss = 9}, {.smallest = 0.09, .loss = 1}, kLoss);
}

TEST(MeritByLoss, WithUncertifiedCellsOnlyTheLossCounts) {
  expect_order({.uncertified = 1, .smallest = -1, .loss = 1}, {.uncertified = 1, .smallest = -0.1, .loss = 1.001},
               kLoss);
}

TEST(MeritByLoss, BelowTheBoundTheMinimumMustBeHalfOfTheHighest) {
  expect_order({.smallest = 0.08, .loss = 9}, {.smallest = 0.03, .loss = 1}, kLoss);
  expect_order({.smallest = 0.05, .loss = 1}, {.smallest = 0.08, .loss = 2}, kLoss);
  Asked after_a_higher_one = kLoss;
  after_a_higher_one.highest_minimum = 0.09;
  expect_order({.smallest = 0.05, .loss = 2}, {.smallest = 0.04, .loss = 1}, after_a_higher_one);
}

TEST(MeritByLoss, AHigherMinimumIsWorthTwoPercentOfTheLoss) {
  expect_order({.smallest = 0.3, .loss = 1.01}, {.smallest = 0.2, .loss = 1}, kLoss);
  expect_order({.smallest = 0.2, .loss = 1}, {.smallest = 0.3, .loss = 1.03}, kLoss);
}

TEST(MeritByLoss, TheTwoPercentAreOfTheLeastLossOfAll) {
  Asked after_a_lower_one = kLoss;
  after_a_lower_one.least_loss = 0.985;
  expect_order({.smallest = 0.2, .loss = 1}, {.smallest = 0.3, .loss = 1.01}, after_a_lower_one);
}

TEST(MeritByLoss, AMinimumAboveTheWantedIsWorthNothing) {
  expect_order({.smallest = 0.6, .loss = 1}, {.smallest = 0.9, .loss = 1.01}, kLoss);
  expect_order({.smallest = 0.9, .loss = 1}, {.smallest = 0.6, .loss = 1}, kLoss);
}

TEST(MeritByLoss, AMeshThatCameInValidIsGivenUpForAGainOnly) {
  Asked asked = kLoss;
  asked.loss_as_it_came = 1;
  const Merit came{.smallest = 0.3, .loss = 1};
  EXPECT_TRUE(is_better({.smallest = 0.3, .loss = 0.98}, came, asked));
  EXPECT_FALSE(is_better({.smallest = 0.3, .loss = 0.995}, came, asked)) << "next to nothing";
  EXPECT_TRUE(is_better({.smallest = 0.31, .loss = 0.995}, came, asked)) << "a higher minimum";
  EXPECT_FALSE(is_better({.smallest = 0.4, .loss = 1.001}, came, asked)) << "a higher loss, if by less than 2 %";
}

// ===== what a mesh that came in valid keeps =====

TEST(Merit, IsLowerOnlyIfBothTheMinimumAndTheMeanAre) {
  const Merit came{.smallest = 0.5, .mean = 0.9};
  EXPECT_TRUE(is_lower({.smallest = 0.4, .mean = 0.8}, came));
  EXPECT_FALSE(is_lower({.smallest = 0.4, .mean = 0.9}, came));
  EXPECT_FALSE(is_lower({.smallest = 0.5, .mean = 0.8}, came));
  EXPECT_FALSE(is_lower({.smallest = 0.4995, .mean = 0.8}, came, threshold::kHigher));
}

TEST(Merit, AccuracyMayLowerTheShapesThatNeedNone) {
  const Merit good{.smallest = 0.9, .mean = 0.95}, poor{.smallest = 0.4, .mean = 0.9};
  EXPECT_FALSE(costs_shape({.smallest = threshold::kWanted, .mean = 0.8}, good));
  EXPECT_TRUE(costs_shape({.smallest = threshold::kWanted - 0.01, .mean = 0.8}, good));
  EXPECT_TRUE(costs_shape({.smallest = 0.3, .mean = 0.8}, poor));
  EXPECT_FALSE(costs_shape({.smallest = 0.3, .mean = 0.9}, poor));
  EXPECT_FALSE(costs_shape({.smallest = 0.3995, .mean = 0.8}, poor)) << "as high, but for what is proved";
}

TEST(Merit, AnUnknownLossIsNotKept) {
  EXPECT_TRUE(keeps_loss({.loss = 1}, {.loss = 1}));
  EXPECT_FALSE(keeps_loss({.loss = 1.001}, {.loss = 1}));
  EXPECT_FALSE(keeps_loss({}, {.loss = 1}));
}

// ===== where a merit comes from =====

TEST(Merit, ComesFromAReport) {
  QualityReport report;
  report.min_scaled_jacobian = 0.25;
  report.mean_scaled_jacobian = 0.5;
  report.uncertified.resize(3);
  EXPECT_EQ(merit_of(report).loss, std::numeric_limits<double>::infinity()) << "a quick report leaves it out";
  report.accuracy = Accuracy{.loss = 0.125, .modal_parts = {}};
  const Merit merit = merit_of(report);
  EXPECT_EQ(merit.uncertified, 3);
  EXPECT_EQ(merit.smallest, 0.25);
  EXPECT_EQ(merit.mean, 0.5);
  EXPECT_EQ(merit.loss, 0.125);
  EXPECT_FALSE(merit.weak.has_value());
}

TEST(Merit, CountsUndecidedCellsAsUncertified) {
  const Merit merit =
      merit_of(CertificateSummary{.valid = 5, .invalid = 2, .undecided = 1, .min_scaled_jacobian_lower_bound = -0.5});
  EXPECT_EQ(merit.uncertified, 3);
  EXPECT_EQ(merit.smallest, -0.5);
}

TEST(Merit, TheOptionsSayWhatIsAskedFor) {
  Options options;
  options.min_js = 0.2;
  options.objective = Objective::Accuracy;
  EXPECT_EQ(asked_by(options).what, Asked::What::Loss);
  EXPECT_EQ(asked_by(options).bound, 0.2);
  options.until = Until::Valid;
  EXPECT_EQ(asked_by(options).what, Asked::What::Minimum) << "such a run lowers no loss";
  options = {};
  options.objective = Objective::Worst;
  EXPECT_EQ(asked_by(options).what, Asked::What::Minimum);
}

// ===== the error in layers =====

/// The errors of four profiles in layers.
QualityReport with_errors_in_layers(std::vector<double> of_profiles) {
  QualityReport report;
  report.in_layers = LayerError{1, 8, std::move(of_profiles)};
  return report;
}

TEST(LosesLayers, IfTheErrorOfOneProfileRises) {
  const QualityReport came = with_errors_in_layers({0.2, 0.1, 0.03, 0.01});
  EXPECT_FALSE(loses_layers(came, came, {}));
  EXPECT_FALSE(loses_layers(came, with_errors_in_layers({0.2, 0.1, 0.01, 0.0101}), {}));
  EXPECT_TRUE(loses_layers(came, with_errors_in_layers({0.1, 0.05, 0.01, 0.0103}), {})) << "the mean has fallen";
  EXPECT_TRUE(loses_layers(came, with_errors_in_layers({0.1, 0.05, 0.01, 0.0101}), {}, 1));
  EXPECT_TRUE(loses_layers(came, with_errors_in_layers({0.1, 0.05}), {})) << "two are not known any more";
  EXPECT_TRUE(loses_layers(came, {}, {})) << "none is known any more";
  EXPECT_FALSE(loses_layers({}, came, {})) << "there were no layers";
}

TEST(LosesLayers, NothingIfAllIsRounding) {
  EXPECT_FALSE(loses_layers(with_errors_in_layers({1e-13}), with_errors_in_layers({3e-13}), {}));
}

TEST(LosesLayers, UnlessTheirSpacingIsToChangeOrTheMeshCameInvalid) {
  Options even;
  even.layer_spacing = LayerSpacing::Even;
  EXPECT_FALSE(loses_layers(with_errors_in_layers({1}), with_errors_in_layers({2}), even));
  QualityReport invalid = with_errors_in_layers({1});
  invalid.uncertified.resize(1);
  EXPECT_FALSE(loses_layers(invalid, with_errors_in_layers({2}), {}));
}

// ===== a mesh on the way to the end of a run =====

TEST(GainsWithoutLoss, IfTheLossFallsAndNothingElseIsLost) {
  Options options;
  options.objective = Objective::Accuracy;
  const auto report = [](double loss, double minimum, double mean, double in_layers) {
    QualityReport made = with_errors_in_layers({in_layers});
    made.accuracy = Accuracy{loss, {}};
    made.min_scaled_jacobian = made.certified.min_scaled_jacobian_lower_bound = minimum;
    made.mean_scaled_jacobian = mean;
    made.certified.valid = 8;
    return made;
  };
  const QualityReport came = report(1e-3, 0.4, 0.9, 0.1);
  EXPECT_TRUE(gains_without_loss(came, report(5e-4, 0.4, 0.9, 0.1), options));
  EXPECT_FALSE(gains_without_loss(came, report(9.99e-4, 0.4, 0.9, 0.1), options)) << "too little is gained";
  EXPECT_FALSE(gains_without_loss(came, report(5e-4, 0.3, 0.8, 0.1), options)) << "it costs shape";
  EXPECT_FALSE(gains_without_loss(came, report(5e-4, 0.4, 0.9, 0.1001), options)) << "it loses in the layers";
}

}  // namespace
}  // namespace varimesh
