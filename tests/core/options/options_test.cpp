// check() refuses numbers out of range, with the option's name and range, and combinations that contradict each other.
#include "core/options/options.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/options/option_table.h"

namespace varimesh {
namespace {

std::string refusal(const Options& options) {
  const auto checked = check(options);
  if (checked) return "";
  EXPECT_EQ(checked.error().kind, Error::Kind::BadOption);
  return checked.error().sentence;
}

/// The options with this number set.
Options with(const OptionInfo& info, double value) {
  Options options;
  if (info.name == "rings") options.region_below = 0.5;
  if (const auto* real = std::get_if<double Options::*>(&info.member)) options.*(*real) = value;
  if (const auto* whole = std::get_if<int Options::*>(&info.member)) options.*(*whole) = static_cast<int>(value);
  return options;
}

TEST(CheckOptions, TakesTheDefaults) { EXPECT_EQ(refusal({}), ""); }

TEST(CheckOptions, RefusesANumberBeyondEitherEndOfItsRangeByName) {
  for (const OptionInfo& info : option_table()) {
    if (!is_number(info)) continue;
    const bool whole = std::holds_alternative<int Options::*>(info.member);
    const double least = info.range.least, most = info.range.most;
    const double under = whole ? least - 1 : std::nextafter(least, -1);
    EXPECT_NE(refusal(with(info, under)).find(std::string(info.name) + " is "), std::string::npos) << info.name;
    EXPECT_EQ(refusal(with(info, least)).empty(), !info.range.without_least) << info.name;
    if (!std::isfinite(most)) continue;
    const double over = whole ? most + 1 : std::nextafter(most, 1e9);
    EXPECT_NE(refusal(with(info, over)).find(std::string(info.values)), std::string::npos) << info.name;
  }
}

TEST(CheckOptions, RefusesInfinityAndWhatIsNotANumber) {
  for (const OptionInfo& info : option_table())
    if (std::holds_alternative<double Options::*>(info.member)) {
      EXPECT_NE(refusal(with(info, std::numeric_limits<double>::quiet_NaN())), "") << info.name;
      EXPECT_NE(refusal(with(info, std::numeric_limits<double>::infinity())), "") << info.name;
    }
}

TEST(CheckOptions, RefusesCombinationsThatContradictEachOther) {
  Options options;
  options.target = Target::Size;
  EXPECT_NE(refusal(options).find("target_field is empty"), std::string::npos);
  options.target_field.values = {1};
  EXPECT_EQ(refusal(options), "");
  options.repair = Repair::Split;
  EXPECT_NE(refusal(options).find("repair is split"), std::string::npos);
  options = {};
  options.target_field.values = {1};
  EXPECT_NE(refusal(options).find("target_field is given"), std::string::npos);
  options = {};
  options.objective = Objective::Worst;
  options.until_js = .5;
  EXPECT_NE(refusal(options).find("objective is worst"), std::string::npos);
  options.objective = Objective::Accuracy;
  EXPECT_NE(refusal(options).find("objective is accuracy"), std::string::npos);
  options.until_js = 0;
  EXPECT_EQ(refusal(options), "");
  options.min_js = 1;
  EXPECT_NE(refusal(options).find("min_js"), std::string::npos);
  options = {};
  options.layer_spacing = LayerSpacing::Graded;
  EXPECT_EQ(refusal(options), "");
  options.objective = Objective::Energy;
  EXPECT_NE(refusal(options).find("layer_spacing"), std::string::npos);
  options.objective = Objective::Auto;
  options.energy = Energy::Winslow;
  EXPECT_NE(refusal(options).find("layer_spacing"), std::string::npos);
  options = {};
  options.repair = Repair::Split;
  options.region_below = .5;
  EXPECT_NE(refusal(options).find("region_below"), std::string::npos);
}

TEST(CheckOptions, RefusesWhatTheEnergyDoesNotUse) {
  struct Case {
    const char* option;
    void (*set)(Options& options);
    const char* user;
  };
  const auto refused = [](Options options, const Case& one) {
    one.set(options);
    return refusal(options);
  };
  const Case kappa = {"kappa", [](Options& o) { o.kappa = 3; }, "linear-elastic with the volumetric part log"};
  const Case lambda = {"lambda", [](Options& o) { o.lambda = 3; }, "hyperelastic, or linear-elastic"};
  const Case mu = {"mu", [](Options& o) { o.mu = 3; }, "hyperelastic or linear-elastic"};
  const Case strain = {"strain", [](Options& o) { o.strain = Strain::Small; }, "linear-elastic"};
  const Case volumetric = {"volumetric", [](Options& o) { o.volumetric = Volumetric::Trace; }, "linear-elastic"};
  const Case winslow = {"winslow", [](Options& o) { o.winslow = Winslow::Paper; }, "the energy winslow"};
  Options hyperelastic, linear, trace, winslows;
  linear.energy = trace.energy = Energy::LinearElastic;
  trace.volumetric = Volumetric::Trace;
  winslows.energy = Energy::Winslow;
  const auto expect = [&](const Options& options, const std::vector<Case>& used, const std::vector<Case>& unused) {
    for (const Case& one : used) EXPECT_EQ(refused(options, one), "") << one.option;
    for (const Case& one : unused) {
      const std::string sentence = refused(options, one);
      EXPECT_TRUE(sentence.starts_with(std::string(one.option) + " is given, but only ")) << sentence;
      EXPECT_NE(sentence.find(one.user), std::string::npos) << sentence;
    }
  };
  expect(hyperelastic, {mu, lambda}, {kappa, strain, volumetric, winslow});
  expect(linear, {mu, kappa, strain, volumetric}, {lambda, winslow});
  expect(trace, {mu, lambda, strain}, {kappa, winslow});
  expect(winslows, {winslow}, {mu, lambda, kappa, strain, volumetric});
}

TEST(CheckOptions, RefusesRingsAroundNothing) {
  Options options;
  options.rings = 3;
  EXPECT_NE(refusal(options).find("region_below"), std::string::npos);
  options.region_below = 0.5;
  EXPECT_EQ(refusal(options), "");
}

/// Sets the option to a value that is not its default.
void change(const OptionInfo& info, Options& options) {
  if (const auto* real = std::get_if<double Options::*>(&info.member)) options.*(*real) = 0.75;
  if (const auto* whole = std::get_if<int Options::*>(&info.member)) options.*(*whole) = 7;
  if (const auto* choice = std::get_if<ChoiceMember>(&info.member))
    choice->set(options, choice->get(options) == 0 ? 1 : 0);
}

TEST(ObjectiveOf, IsAccuracyUnlessAnOptionOfTheEnergyIsNamed) {
  EXPECT_EQ(objective_of({}, 2), Objective::Accuracy);
  int of_energy = 0;
  for (const OptionInfo& info : option_table()) {
    Options options;
    change(info, options);
    if (info.name == "objective") continue;
    EXPECT_EQ(objective_of(options, 3), is_of_energy(info) ? Objective::Energy : Objective::Accuracy) << info.name;
    of_energy += is_of_energy(info) ? 1 : 0;
    EXPECT_EQ(is_of_energy(info) && is_default(info, options), false) << info.name;
  }
  EXPECT_EQ(of_energy, 13);
}

TEST(ObjectiveOf, IsTheEnergyInOrderOne) { EXPECT_EQ(objective_of({}, 1), Objective::Energy); }

TEST(ObjectiveOf, IsTheOneThatIsNamed) {
  for (const Objective objective : {Objective::Energy, Objective::Worst, Objective::Accuracy}) {
    Options options;
    options.objective = objective;
    options.lambda = 3;
    EXPECT_EQ(objective_of(options, 1), objective);
  }
}

}  // namespace
}  // namespace varimesh
