// The error in layers against sums in one dimension, and what it says about meshes whose order is known.
#include "core/layers/error/layer_error.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/index.h"
#include "core/optimise/optimiser.h"
#include "tests/core/layers/layer_meshes.h"

namespace varimesh {
namespace {

std::optional<LayerError> error_of(const HighOrderMesh& mesh, int threads = 2) {
  const Team team(threads);
  Facets found;
  team.run([&] { found = facets(mesh, team); });
  return layer_error(mesh, found, team);
}

double error_at(const HighOrderMesh& mesh) {
  const auto found = error_of(mesh);
  EXPECT_TRUE(found.has_value());
  return found ? found->error : 0;
}

/// The slope at s in [0, 1] of the polynomial through these values at equally spaced places.
double slope(const std::vector<double>& values, double s) {
  const int order = static_cast<int>(values.size()) - 1;
  double sum = 0;
  for (int i = 0; i <= order; ++i) {
    double of_basis = 0;
    for (int j = 0; j <= order; ++j) {
      if (j == i) continue;
      double product = 1.0 / (i - j);
      for (int k = 0; k <= order; ++k)
        if (k != i && k != j) product *= (order * s - k) / (i - k);
      of_basis += product;
    }
    sum += order * values[at(i)] * of_basis;
  }
  return sum;
}

/// The same error for layers of these heights along a line, by the midpoint rule.
double error_along_a_line(const Layers& layers) {
  double squares = 0;
  int profiles = 0;
  for (double delta = layers.first; delta <= layers.height(layers.count) * (1 + 1e-9); delta *= 2, ++profiles) {
    double missed = 0, all = 0;
    for (int layer = 0; layer < layers.count; ++layer) {
      const double from = layers.height(layer), height = layers.height(layer + 1) - from;
      std::vector<double> values;
      for (int i = 0; i <= layers.order; ++i) values.push_back(std::exp(-(from + height * i / layers.order) / delta));
      constexpr int kPieces = 2000;
      for (int piece = 0; piece < kPieces; ++piece) {
        const double s = (piece + 0.5) / kPieces, exact = -std::exp(-(from + height * s) / delta) / delta;
        missed += height / kPieces * std::pow(exact - slope(values, s) / height, 2);
        all += height / kPieces * exact * exact;
      }
    }
    squares += missed / all;
  }
  return std::sqrt(squares / profiles);
}

TEST(LayerError, IsThatOfInterpolationAcrossFlatLayers) {
  for (const Shape shape : {Shape::Quadrilateral, Shape::Triangle, Shape::Hexahedron, Shape::Prism, Shape::Tetrahedron})
    for (const int order : {1, 2, 4}) {
      const Layers layers{shape, order, 6, 1e-3, 1.9, Inside::Parallel, false};
      const HighOrderMesh mesh = make(layers);
      const auto found = error_of(mesh);
      ASSERT_TRUE(found.has_value()) << reference::info(shape).name;
      const double wanted = error_along_a_line(layers);
      EXPECT_NEAR(found->error, wanted, 2e-3 * wanted) << reference::info(shape).name << " of order " << order;
      EXPECT_EQ(found->cells, static_cast<std::int64_t>(mesh.element_count(mesh.dimension)));
    }
}

TEST(LayerError, DoesNotDependOnPlaceSizeOrThreads) {
  for (const Shape shape : {Shape::Triangle, Shape::Prism}) {
    HighOrderMesh mesh = make({shape, 3, 7, 1e-3, 2, Inside::Parallel});
    const double before = error_at(mesh);
    EXPECT_EQ(error_of(mesh, 1)->error, before);
    const bool is_flat = mesh.dimension == 2;
    for (std::size_t node = 0; node < mesh.node_count(); ++node) {
      double* const x = &mesh.coordinates[3 * node];
      const double turned[3] = {0.6 * x[0] - 0.8 * x[1], 0.8 * x[0] + 0.6 * x[1], x[2]};
      for (std::size_t c = 0; c < 3; ++c) x[c] = c == 2 && is_flat ? 0 : 70 * turned[c] + 5;
    }
    EXPECT_NEAR(error_at(mesh), before, 1e-9 * before);
  }
}

/// Round a quarter of a circle with the radius 1, with 8 layers. The errors are those that another program finds from
/// the formula, with the exact place of every node.
TEST(LayerError, OfGradedAndEvenNodesIsThatOfAnotherProgram) {
  for (const Shape shape : {Shape::Quadrilateral, Shape::Triangle}) {
    const HighOrderMesh even = make({shape, 3, 8, 1e-2, 1.9, Inside::Parallel});
    HighOrderMesh graded = even;
    graded.coordinates = start(even, LayerSpacing::Graded).coordinates;
    ASSERT_EQ(graded.coordinates.size(), even.coordinates.size());
    EXPECT_NEAR(error_at(even), 4.395e-3, 1e-3 * 4.395e-3) << reference::info(shape).name;
    EXPECT_NEAR(error_at(graded), 1.9226e-3, 2e-3 * 1.9226e-3) << reference::info(shape).name;
  }
}

TEST(LayerError, IsAbsentWithoutLayersAndWhereALayerIsInvalid) {
  EXPECT_FALSE(error_of(make({Shape::Quadrilateral, 3, 3, 0.3, 1, Inside::Parallel})).has_value());
  const HighOrderMesh tangled = make({Shape::Quadrilateral, 3, 8, 1e-4, 3, Inside::StraightSided});
  ASSERT_GT(uncertified(tangled, tangled.coordinates), 0);
  EXPECT_FALSE(error_of(tangled).has_value());
}

TEST(LayerError, IsReportedByRunsThatTreatLayers) {
  const HighOrderMesh even = make({Shape::Quadrilateral, 3, 8, 1e-3, 2, Inside::Parallel});
  Options options;
  options.layer_spacing = LayerSpacing::Graded;
  const auto graded = optimise(even, options), kept = optimise(even);
  ASSERT_TRUE(graded.has_value() && kept.has_value());
  ASSERT_TRUE(graded->before.in_layers && graded->after.in_layers && kept->before.in_layers && kept->after.in_layers);
  EXPECT_EQ(kept->after.in_layers->error, kept->before.in_layers->error);
  EXPECT_EQ(graded->before.in_layers->error, kept->before.in_layers->error);
  EXPECT_LT(graded->after.in_layers->error, 0.9 * graded->before.in_layers->error);
}

}  // namespace
}  // namespace varimesh
