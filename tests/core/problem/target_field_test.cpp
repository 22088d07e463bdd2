// Fields of sizes and strains: read from text, matched with a mesh, and refused with a sentence.
#include "core/problem/target_field.h"

#include <gtest/gtest.h>

#include <vector>

#include "core/optimise/optimiser.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

// === From text ===========================================================================================

TEST(TargetFieldText, HoldsNumbersOrTensorsByElementOrNode) {
  const auto sizes = read_target_field("# sizes\nelements\n 7 0.5\n\n12 1e-3 # small\n");
  ASSERT_TRUE(sizes) << sizes.error().sentence;
  EXPECT_EQ(sizes->per, Per::Cell);
  EXPECT_EQ(sizes->components, 1);
  EXPECT_EQ(sizes->numbers, (std::vector<std::int64_t>{7, 12}));
  EXPECT_EQ(sizes->values, (std::vector<double>{0.5, 1e-3}));
  const auto metric = read_target_field("nodes\n1 4 0 16\n2 4 1 16");
  ASSERT_TRUE(metric) << metric.error().sentence;
  EXPECT_EQ(metric->per, Per::Vertex);
  EXPECT_EQ(metric->components, 3);
}

TEST(TargetFieldText, NamesTheLineThatIsWrong) {
  for (const auto& [text, line] : {std::pair{"1 0.5\n", "Line 1"},
                                   {"elements\n1 0.5\nx 0.5\n", "Line 3"},
                                   {"elements\n1\n", "Line 2"},
                                   {"elements\n1 2 3 4\n5 6\n", "Line 3"},
                                   {"nodes\n1 nope\n", "Line 2"},
                                   {"nodes\n", "Line 1"}}) {
    const auto read = read_target_field(text);
    ASSERT_FALSE(read) << text;
    EXPECT_NE(read.error().sentence.find(line), std::string::npos) << read.error().sentence;
  }
}

// === On a mesh ===========================================================================================

/// The stretch of a field on a square of 2 × 2 squares, whose elements are numbered from 1.
StretchField resolved(Target target, TargetField field, int order = 1) {
  Options options;
  options.target = target;
  options.target_field = std::move(field);
  const auto stretch = resolve_target_field(testing::grid(Filling::Quadrilaterals, {2, 2, 0}, order), options);
  EXPECT_TRUE(stretch) << stretch.error().sentence;
  return stretch ? *stretch : StretchField{};
}

TEST(TargetFieldOnAMesh, FollowsTheNumbersOfItsElements) {
  const StretchField stretch = resolved(Target::Size, {Per::Cell, 1, {4, 2, 1, 3}, {0.4, 0.2, 0.1, 0.3}});
  EXPECT_EQ(stretch.per, Per::Cell);
  EXPECT_EQ(stretch.components, 1);
  EXPECT_EQ(stretch.values, (std::vector<double>{0.1, 0.2, 0.3, 0.4}));
}

TEST(TargetFieldOnAMesh, FollowsTheMeshsOrderWhereItHasNoNumbers) {
  EXPECT_EQ(resolved(Target::Size, {Per::Cell, 1, {}, {1, 2, 3, 4}}).values, (std::vector<double>{1, 2, 3, 4}));
}

TEST(TargetFieldOnAMesh, TurnsAMetricIntoItsInverseSquareRoot) {
  // M = [[5, 4], [4, 5]] has the eigenvalues 1 and 9, so M^(−1/2) has 1 and 1/3: [[2/3, −1/3], [−1/3, 2/3]].
  const StretchField stretch = resolved(Target::Size, {Per::Cell, 3, {}, {5, 4, 5, 4, 0, 16, 5, 4, 5, 1, 0, 1}});
  const std::vector<double> expected{2. / 3, -1. / 3, 2. / 3, 0.5, 0, 0.25, 2. / 3, -1. / 3, 2. / 3, 1, 0, 1};
  ASSERT_EQ(stretch.values.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(stretch.values[i], expected[i], 1e-14) << i;
}

TEST(TargetFieldOnAMesh, AddsOneToAStrainAndNoneWhereNothingIsSaid) {
  EXPECT_EQ(resolved(Target::Strain, {Per::Cell, 1, {2}, {0.25}}).values, (std::vector<double>{1, 1.25, 1, 1}));
  EXPECT_EQ(resolved(Target::Strain, {Per::Cell, 3, {2}, {0.25, 0.5, -0.25}}).values,
            (std::vector<double>{1, 0, 1, 1.25, 0.5, 0.75, 1, 0, 1, 1, 0, 1}));
}

TEST(TargetFieldOnAMesh, NeedsNoValueAtNodesThatAreNoVertices) {
  const HighOrderMesh mesh = testing::grid(Filling::Quadrilaterals, {2, 2, 0}, 3);
  const std::vector<bool> vertex = testing::vertex_nodes(mesh);
  TargetField field{Per::Vertex, 1, {}, {}};
  for (std::size_t n = 0; n < mesh.node_count(); ++n)
    if (vertex[n]) {
      field.numbers.push_back(mesh.node_numbers[n]);
      field.values.push_back(0.5);
    }
  ASSERT_LT(field.numbers.size(), mesh.node_count());
  const StretchField stretch = resolved(Target::Size, field, 3);
  for (std::size_t n = 0; n < mesh.node_count(); ++n) EXPECT_EQ(stretch.values[n], vertex[n] ? 0.5 : 1.0);
}

TEST(TargetFieldOnAMesh, IsNoneForOtherTargets) {
  EXPECT_EQ(resolved(Target::StraightSided, {}).components, 0);
  EXPECT_EQ(resolved(Target::Ideal, {}).components, 0);
}

TEST(TargetFieldOnAMesh, IsRefusedWithASentenceIfItDoesNotFit) {
  const HighOrderMesh mesh = testing::grid(Filling::Triangles, {2, 2, 0}, 2);
  const auto sentence = [&](Target target, TargetField field) {
    Options options;
    options.target = target;
    options.target_field = std::move(field);
    const auto refused = optimise(mesh, options);
    return refused ? std::string("taken") : refused.error().sentence;
  };
  const auto expect = [](const std::string& sentence, const std::string& word) {
    EXPECT_NE(sentence.find(word), std::string::npos) << sentence;
  };
  expect(sentence(Target::Size, {}), "empty");
  expect(sentence(Target::Ideal, {Per::Cell, 1, {1}, {1.0}}), "takes no field");
  expect(sentence(Target::Size, {Per::Cell, 1, {1}, {1.0}}), "no size for element 2");
  expect(sentence(Target::Size, {Per::Vertex, 1, {1}, {1.0}}), "no size for node 2");
  expect(sentence(Target::Size, {Per::Cell, 1, {1, 1}, {1.0, 1.0}}), "twice");
  expect(sentence(Target::Size, {Per::Cell, 1, {999}, {1.0}}), "element 999");
  expect(sentence(Target::Size, {Per::Cell, 1, {1}, {-1.0}}), "not positive");
  expect(sentence(Target::Size, {Per::Cell, 3, {1}, {1.0, 2.0, 1.0}}), "not positive");
  expect(sentence(Target::Size, {Per::Cell, 6, {1}, {1, 0, 1, 0, 0, 1}}), "components");
  expect(sentence(Target::Size, {Per::Cell, 1, {}, {1.0}}), "8 cells");
  expect(sentence(Target::Strain, {Per::Cell, 1, {3}, {-1.0}}), "not above -1");
}

}  // namespace
}  // namespace varimesh
