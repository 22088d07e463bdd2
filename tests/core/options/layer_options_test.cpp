// Layers are refused if no mesh could have them.
#include "core/options/layer_options.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "core/options/option_table.h"

namespace varimesh {
namespace {

/// The sentence with which layers are refused that differ from good ones as `change` says; empty if they are not.
std::string refusal(const std::function<void(LayerOptions&)>& change) {
  LayerOptions options;
  options.walls = {"wall"};
  options.layers = 3;
  options.first = 0.1;
  change(options);
  const auto checked = check(options);
  return checked ? "" : checked.error().sentence;
}

TEST(LayerOptions, NeedTwoNumbersOrAList) {
  EXPECT_EQ(refusal([](LayerOptions&) {}), "");
  EXPECT_EQ(refusal([](LayerOptions& o) { o.growth = 2; }), "");
  EXPECT_NE(refusal([](LayerOptions& o) { o.first = 0; }).find("are not known"), std::string::npos);
  EXPECT_NE(refusal([](LayerOptions& o) { o.heights = {0.1}; }).find("either the list or"), std::string::npos);
  const auto list = [](LayerOptions& o) { o.layers = 0, o.first = 0, o.heights = {0.1, 0.2}; };
  EXPECT_EQ(refusal(list), "");
  EXPECT_NE(refusal([&](LayerOptions& o) { list(o), o.heights[1] = -0.2; }).find("not a positive number"),
            std::string::npos);
  EXPECT_NE(refusal([&](LayerOptions& o) { list(o), o.heights.assign(kMostLayers + 1, 0.1); }).find("1001 heights"),
            std::string::npos);
}

TEST(LayerOptions, FitIntoTheLayerThatIsGrown) {
  EXPECT_EQ(refusal([](LayerOptions& o) { o.grow = 0.3; }), "");
  EXPECT_NE(refusal([](LayerOptions& o) { o.grow = 0.29; }).find("at least 0.3"), std::string::npos);
  EXPECT_EQ(refusal([](LayerOptions& o) { o.grow = 0.7, o.growth = 2; }), "");
  EXPECT_NE(refusal([](LayerOptions& o) { o.grow = 0.6, o.growth = 2; }).find("Grow a thicker one"), std::string::npos);
  EXPECT_NE(refusal([](LayerOptions& o) { o.grow = 1, o.rows = 2; }).find("Split one"), std::string::npos);
  EXPECT_NE(
      refusal([](LayerOptions& o) { o.grow = 1, o.layers = 0, o.first = 1e-9, o.growth = 1; }).find("more than 1000"),
      std::string::npos);
  EXPECT_NE(refusal([](LayerOptions& o) { o.first = 0, o.layers = 1000, o.growth = 10; }).find("times as high"),
            std::string::npos);
}

TEST(LayerOptions, AreRefusedOutOfTheirRange) {
  EXPECT_EQ(refusal([](LayerOptions& o) { o.first = -1; }),
            "first is -1; give a length, or 0 if the other numbers give it.");
  EXPECT_NE(refusal([](LayerOptions& o) { o.first = NAN; }), "");
  EXPECT_NE(refusal([](LayerOptions& o) { o.growth = 0.5; }).find("is below 1"), std::string::npos);
  EXPECT_EQ(refusal([](LayerOptions& o) { o.growth = 11; }),
            "growth is 11; give 1 to 10, or 0 if the other numbers give it.");
  EXPECT_NE(refusal([](LayerOptions& o) { o.layers = kMostLayers + 1; }), "");
  EXPECT_NE(refusal([](LayerOptions& o) { o.rows = 0; }), "");
  EXPECT_NE(refusal([](LayerOptions& o) { o.walls.clear(); }).find("no wall"), std::string::npos);
  EXPECT_NE(refusal([](LayerOptions& o) { o.spacing = LayerSpacing::Keep; }).find("even or graded"), std::string::npos);
}

}  // namespace
}  // namespace varimesh
