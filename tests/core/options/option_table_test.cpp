// The table has the same types, defaults and words as Options, and a sentence of help for each option.
#include "core/options/option_table.h"

#include <gtest/gtest.h>

#include <algorithm>
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
  EXPECT_EQ(last_word("repair", [](Options& o) { o.repair = Repair::Topology; }), "topology");
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
  const auto check = [](const auto& table) {
    for (const auto& info : table) {
      EXPECT_GT(info.help.size(), 10u) << info.name;
      EXPECT_FALSE(info.help.ends_with('.')) << info.name;
      EXPECT_EQ(is_number(info), !info.values.empty())
          << info.name << ": numbers have their range in words, and only numbers";
    }
  };
  check(option_table());
  check(geometry_option_table());
  check(layer_option_table());
}

TEST(GeometryOptionTable, HasTheDefaultsAndWordsOfTheStruct) {
  for (const auto& [name, usual] : {std::pair{"slide", "auto"}, std::pair{"slide_on", "model"},
                                    std::pair{"tolerance", "0"}, std::pair{"snap", "off"}})
    EXPECT_EQ(std::ranges::count_if(
                  geometry_option_table(),
                  [&](const GeometryOption& option) { return option.name == name && default_text(option) == usual; }),
              1)
        << name;
  for (const GeometryOption& option : geometry_option_table())
    if (const auto* member = std::get_if<ChoiceOf<GeometryOptions>>(&option.member)) {
      GeometryOptions options;
      for (int word = 0; word < static_cast<int>(member->words.size()); ++word) {
        member->set(options, word);
        EXPECT_EQ(member->get(options), word) << option.name;
      }
    }
}

TEST(GeometryOptions, AreRefusedOutOfTheirRangeOrIfTheyDoNotGoTogether) {
  EXPECT_TRUE(check(GeometryOptions()));
  const auto refused = [](auto set) {
    GeometryOptions options;
    set(options);
    const auto fine = check(options);
    EXPECT_FALSE(fine);
    return fine ? std::string() : fine.error().sentence;
  };
  EXPECT_EQ(refused([](auto& o) { o.smooth_angle = 46; }), "smooth_angle is 46; give degrees from 0 to 45.");
  EXPECT_NE(refused([](auto& o) { o.tolerance = -1; }).find("tolerance is -1"), std::string::npos);
  EXPECT_NE(refused([](auto& o) { o.tolerance = 1; }).find("only with slide coupled"), std::string::npos);
  EXPECT_EQ(refused([](auto& o) { o.growth = 0.9; }), "growth is 0.9; give a number, 1 or more.");
  EXPECT_NE(refused([](auto& o) { o.order = 11; }).find("order is 11"), std::string::npos);
  for (const auto set : {+[](GeometryOptions& o) { o.file = "part.step"; }, +[](GeometryOptions& o) { o.order = 3; },
                         +[](GeometryOptions& o) { o.snap = true; }, +[](GeometryOptions& o) { o.smooth_angle = 5; },
                         +[](GeometryOptions& o) { o.slide = SlideOn::Coupled; }})
    EXPECT_NE(refused([&](auto& o) {
                o.slide_on = GeometrySource::Boundary;
                set(o);
              }).find("boundary"),
              std::string::npos);
}

}  // namespace
}  // namespace varimesh
