// The heights of layers from two of three numbers, and cuts of an edge.
#include "core/layers/split/layer_heights.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "core/layers/split/edge_cut.h"

namespace varimesh::detail {
namespace {

double sum(const std::vector<double>& heights) { return std::accumulate(heights.begin(), heights.end(), 0.0); }

LayerOptions layers(int number, double first, double growth, std::vector<double> heights = {}) {
  LayerOptions options;
  options.layers = number;
  options.first = first;
  options.growth = growth;
  options.heights = std::move(heights);
  return options;
}

TEST(LayerHeights, FillAColumn) {
  for (const double column : {0.3, 1.0, 40.0})
    for (const int number : {2, 5, 60}) {
      const auto by_first = heights_in_column(layers(number, 1e-4, 0), number, column);
      ASSERT_EQ(by_first.size(), static_cast<std::size_t>(number));
      EXPECT_NEAR(sum(by_first), column, 1e-11 * column);
      EXPECT_EQ(by_first[0], 1e-4);
      const auto by_growth = heights_in_column(layers(number, 0, 1.3), number, column);
      EXPECT_NEAR(sum(by_growth), column, 1e-11 * column);
      EXPECT_NEAR(by_growth[1] / by_growth[0], 1.3, 1e-12);
    }
}

TEST(LayerHeights, ChooseTheNumberOfLayers) {
  EXPECT_EQ(number_of_layers(layers(0, 0.1, 1), 1), 10);
  EXPECT_EQ(number_of_layers(layers(0, 1.0 / 127, 2), 1), 7);
  EXPECT_EQ(number_of_layers(layers(0, 3, 2), 1), 1);
}

TEST(LayerHeights, AreRefusedIfTheyDoNotFit) {
  EXPECT_TRUE(heights_in_column(layers(5, 0.3, 0), 5, 1).empty());
  EXPECT_TRUE(heights_in_column(layers(3, 0.2, 2), 3, 1).empty());
  EXPECT_EQ(heights_in_column(layers(3, 0.1, 2), 3, 1), (std::vector<double>{0.1, 0.2, 0.4}));
  EXPECT_TRUE(heights_in_column(layers(0, 0, 0, {0.5, 0.6}), 2, 1).empty());
}

/// Nodes that lie unevenly on a straight edge do not change where layers are.
TEST(EdgeCut, MeasuresHeightsAlongTheNormal) {
  const std::vector<Eigen::Vector3d> uneven{{0, 0, 0}, {0, 0.25, 0}, {0, 1, 0}};  // y = t²
  const EdgeHeight edge(uneven, {0, 1, 0});
  EXPECT_NEAR(edge.parameter(0.25), 0.5, 1e-15);
  EXPECT_NEAR(edge.parameter(1e-10), 1e-5, 1e-15);
  const std::vector<Eigen::Vector3d> leaning{{0, 0, 0}, {1, 1, 0}};
  EXPECT_NEAR(EdgeHeight(leaning, {0, 1, 0}).total(), 1, 1e-15);
  const std::vector<Eigen::Vector3d> oblique{{0, 0, 0}, {3, 1, 0}};
  EXPECT_NEAR(EdgeHeight(oblique, {0, 1, 0}).total(), std::sqrt(10.0), 1e-15);
  EXPECT_NEAR(EdgeHeight(oblique, {0, 1, 0}, 0.1).total(), 1, 1e-15);
}

TEST(EdgeCut, GradesNodesAsTheLayersGrow) {
  const EdgeHeight edge({{0, 0, 0}, {0, 1, 0}, {0, 2, 0}}, {0, 1, 0});
  const EdgeCut even(edge, {0.5, 1.5}, {3, 3}, 100, 2, LayerSpacing::Even);
  EXPECT_NEAR(even.parameter(0, 0.5), 0.125, 1e-15);
  EXPECT_NEAR(even.parameter(1, 0), 0.25, 1e-15);
  EXPECT_EQ(even.parameter(1, 1), 1);
  const EdgeCut graded(edge, {0.5, 1.5}, {3, 3}, 100, 2, LayerSpacing::Graded);
  // t = (3^(.6/2) − 1)/(3^.6 − 1), with full weight in cells as flat as these
  EXPECT_NEAR(graded.parameter(0, 0.5), 0.25 * (std::pow(3, 0.3) - 1) / (std::pow(3, 0.6) - 1), 1e-9);
}

}  // namespace
}  // namespace varimesh::detail
