// What a run hands out if a solver's error in the layers of a valid mesh may be higher where it ended.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "core/optimise/optimiser.h"
#include "core/ranks/thread_ranks.h"
#include "tests/core/layers/layer_meshes.h"

namespace varimesh {
namespace {

/// Layers that are a third to once as high as wide, round a quarter of a circle. Only their sides on the wall are
/// curved.
HighOrderMesh thick_layers(int order) { return make({Shape::Triangle, order, 8, 0.135, 1.17, Inside::StraightSided}); }

bool says(const Result& result, const char* text) {
  return std::ranges::any_of(result.notes,
                             [&](const std::string& note) { return note.find(text) != std::string::npos; });
}

TEST(ThickLayers, OfHighOrderGoPartOfTheWay) {
  for (const int order : {3, 4}) {
    const auto result = optimise(thick_layers(order));
    ASSERT_TRUE(result) << result.error().sentence;
    ASSERT_TRUE(result->before.uncertified.empty() && result->before.in_layers && result->after.in_layers);
    EXPECT_TRUE(says(*result, "of the way to where the run ended")) << order;
    EXPECT_TRUE(result->after.uncertified.empty());
    EXPECT_FALSE(result->converged) << "the run came to rest elsewhere";
    EXPECT_LT(result->after.accuracy->loss, 0.9 * result->before.accuracy->loss);
    const auto &before = result->before.in_layers->of_profiles, &after = result->after.in_layers->of_profiles;
    ASSERT_EQ(before.size(), after.size());
    for (std::size_t k = 0; k < before.size(); ++k) EXPECT_LE(after[k], before[k]) << order << ", profile " << k;
  }
}

TEST(ThickLayers, GoAsFarOnSeveralRanks) {
  Options options;
  options.threads = 1;
  const auto alone = optimise(thick_layers(3), options);
  ASSERT_TRUE(alone) << alone.error().sentence;
  run_as_ranks(3, [&](const Ranks& ranks) {
    RunControl control;
    control.ranks = &ranks;
    const auto together = optimise(thick_layers(3), options, {}, control);
    ASSERT_TRUE(together) << together.error().sentence;
    EXPECT_EQ(together->mesh.coordinates, alone->mesh.coordinates);
    EXPECT_EQ(together->notes, alone->notes);
  });
}

/// A solver's error for exp(−n) would be three times as high, and it rises after a quarter of the way.
TEST(ThickLayers, OfOrderTwoStayAsTheyCame) {
  const HighOrderMesh mesh = thick_layers(2);
  const auto result = optimise(mesh);
  ASSERT_TRUE(result) << result.error().sentence;
  EXPECT_EQ(result->mesh.coordinates, mesh.coordinates);
  EXPECT_TRUE(result->kept_as_it_came.find("a solver's error in the layers") != std::string::npos)
      << result->kept_as_it_came;
}

}  // namespace
}  // namespace varimesh
