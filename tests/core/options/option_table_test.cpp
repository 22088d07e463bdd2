// The table has the same types, defaults and words as Options, and a sentence of help for each option.
#include "core/options/option_table.h"

#include <gtest/gtest.h>

#include <set>

namespace varimesh {
namespace {

const OptionInfo& option(std::string_view name) {
  for (const OptionInfo& info : option_table())
    if (info.name == name) return info;
  throw std::out_of_range(std::string(name));
}

TEST(OptionTable, NamesEachOptionOnce) {
  std::set<std::string_view> names;
  for (const OptionInfo& info : option_table()) EXPECT_TRUE(names.insert(info.name).second) << info.name;
}

TEST(OptionTable, TellsDefaultsAsAUserWritesThem) {
  EXPECT_EQ(default_text(option("energy")), "hyperelastic");
  EXPECT_EQ(default_text(option("constants")), "standard");
  EXPECT_EQ(default_text(option("tolerance")), "0.001");
  EXPECT_EQ(default_text(option("max_iterations")), "1000");
  EXPECT_EQ(default_text(option("active_set")), "on");
  EXPECT_EQ(default_text(option("rings")), "2");
  EXPECT_EQ(default_text(option("fix")), "");
}

TEST(OptionTable, HasAWordForEachValueOfAnEnum) {
  const auto last_word = [](std::string_view name, auto set) {
    Options options;
    set(options);
    const auto& member = std::get<ChoiceMember>(option(name).member);
    EXPECT_EQ(static_cast<std::size_t>(member.get(options)) + 1, member.words.size()) << name;
    return member.words.back();
  };
  EXPECT_EQ(last_word("energy", [](Options& o) { o.energy = Energy::Distortion; }), "distortion");
  EXPECT_EQ(last_word("repair", [](Options& o) { o.repair = Repair::Straighten; }), "straighten");
  EXPECT_EQ(last_word("target", [](Options& o) { o.target = Target::Strain; }), "strain");
  EXPECT_EQ(last_word("method", [](Options& o) { o.method = Method::Newton; }), "newton");
  EXPECT_EQ(last_word("until", [](Options& o) { o.until = Until::Valid; }), "valid");
  EXPECT_EQ(last_word("objective", [](Options& o) { o.objective = Objective::Auto; }), "auto");
}

TEST(OptionTable, SetsTheFieldThatItNames) {
  Options options;
  std::get<ChoiceMember>(option("strain").member).set(options, 1);
  EXPECT_EQ(options.strain, Strain::Small);
  options.*std::get<double Options::*>(option("lambda").member) = 7;
  EXPECT_EQ(options.lambda, 7);
  options.*std::get<int Options::*>(option("rings").member) = 5;
  EXPECT_EQ(options.rings, 5);
}

TEST(OptionTable, HelpsInOneSentenceWithoutAFullStop) {
  for (const OptionInfo& info : option_table()) {
    EXPECT_GT(info.help.size(), 10u) << info.name;
    EXPECT_FALSE(info.help.ends_with('.')) << info.name;
    EXPECT_EQ(is_number(info), !info.values.empty())
        << info.name << ": numbers have their range in words, and only numbers";
  }
}

}  // namespace
}  // namespace varimesh
