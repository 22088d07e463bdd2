// The error in layers against sums in one dimension, and what it says about meshes whose order is known.
#include "core/layers/error/layer_error.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/index.h"
#include "core/optimise/optimiser.h"
#include "tests/core/layers/layer_meshes.h"

namespace varimesh {
namespace {

/// How closely the rule of quadrature follows a profile. The thinnest erfc ends within one cell.
constexpr double kOfExp = 2e-3, kOfErfc = 0.02;

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

/// The squared error of one profile for layers of these heights along a line, by the midpoint rule.
double squared_error_along_a_line(const Layers& layers, double delta, bool is_erfc) {
  const auto value = [&](double n) { return is_erfc ? std::erfc(n / delta) : std::exp(-n / delta); };
  const auto steepness = [&](double n) {
    const double s = n / delta;
    return is_erfc ? -2 / std::sqrt(std::acos(-1.0)) * std::exp(-s * s) / delta : -std::exp(-s) / delta;
  };
  double missed = 0, all = 0;
  for (int layer = 0; layer < layers.count; ++layer) {
    const double from = layers.height(layer), height = layers.height(layer + 1) - from;
    std::vector<double> values;
    for (int i = 0; i <= layers.order; ++i) values.push_back(value(from + height * i / layers.order));
    constexpr int kPieces = 2000;
    for (int piece = 0; piece < kPieces; ++piece) {
      const double s = (piece + 0.5) / kPieces, exact = steepness(from + height * s);
      missed += height / kPieces * std::pow(exact - slope(values, s) / height, 2);
      all += height / kPieces * exact * exact;
    }
  }
  return missed / all;
}

/// The errors of the profiles for layers of these heights along a line.
std::vector<double> errors_along_a_line(const Layers& layers) {
  std::vector<double> errors;
  for (double delta = layers.first; delta <= layers.height(layers.count) * (1 + 1e-9); delta *= 2) {
    if (delta > layers.first) errors.push_back(std::sqrt(squared_error_along_a_line(layers, delta, true)));
    errors.push_back(std::sqrt(squared_error_along_a_line(layers, delta, false)));
  }
  return errors;
}

TEST(LayerError, IsThatOfInterpolationAcrossFlatLayers) {
  for (const Shape shape : {Shape::Quadrilateral, Shape::Triangle, Shape::Hexahedron, Shape::Prism, Shape::Tetrahedron})
    for (const int order : {1, 2, 4}) {
      const Layers layers{shape, order, 6, 1e-3, 1.9, Inside::Parallel, false};
      const HighOrderMesh mesh = make(layers);
      const auto found = error_of(mesh);
      ASSERT_TRUE(found.has_value()) << reference::info(shape).name;
      const std::vector<double> wanted = errors_along_a_line(layers);
      ASSERT_EQ(found->of_profiles.size(), wanted.size());
      double squares = 0;
      for (std::size_t k = 0; k < wanted.size(); ++k) {
        EXPECT_NEAR(found->of_profiles[k], wanted[k], (k % 2 == 0 ? kOfExp : kOfErfc) * wanted[k])
            << reference::info(shape).name << " of order " << order << ", profile " << k;
        if (k % 2 == 0) squares += wanted[k] * wanted[k];
      }
      const double mean = std::sqrt(2 * squares / static_cast<double>(wanted.size() + 1));
      EXPECT_NEAR(found->error, mean, kOfExp * mean) << reference::info(shape).name << " of order " << order;
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
/// the formula, with the distance from the circle. The wall of the mesh, from which the distance counts, is not quite
/// the circle: the gap is a thousandth of the first layer's height.
TEST(LayerError, OfGradedAndEvenNodesIsThatOfAnotherProgram) {
  for (const Shape shape : {Shape::Quadrilateral, Shape::Triangle}) {
    const HighOrderMesh even = make({shape, 3, 8, 1e-2, 1.9, Inside::Parallel});
    HighOrderMesh graded = even;
    graded.coordinates = start(even, LayerSpacing::Graded).coordinates;
    ASSERT_EQ(graded.coordinates.size(), even.coordinates.size());
    const double of_even = 4.397e-3, of_graded = shape == Shape::Quadrilateral ? 1.9292e-3 : 1.9426e-3;
    EXPECT_NEAR(error_at(even), of_even, kOfExp * of_even) << reference::info(shape).name;
    EXPECT_NEAR(error_at(graded), of_graded, 5e-3 * of_graded) << reference::info(shape).name;
  }
}

/// In an element about as high as wide, the distance from the wall is not the polynomial through its values at the
/// nodes, and a solver sees that. On parallel surfaces its error for exp(−n/.3) is .701 times as high, and for exp(−n)
/// 1.33 times.
TEST(LayerError, SeesHowTheDistanceVariesInsideACell) {
  const Layers layers{Shape::Triangle, 2, 8, 0.06041, 1.3895, Inside::StraightSided};
  Layers parallel = layers;
  parallel.inside = Inside::Parallel;
  const auto straight = error_of(make(layers)), on_surfaces = error_of(make(parallel));
  ASSERT_TRUE(straight && on_surfaces && straight->of_profiles.size() == on_surfaces->of_profiles.size());
  ASSERT_EQ(straight->of_profiles.size(), 11U);  // from .06 to 1.93
  const auto share = [&](std::size_t of) { return on_surfaces->of_profiles[of] / straight->of_profiles[of]; };
  EXPECT_LT(share(4), 0.8);  // exp(−n/.24)
  EXPECT_GT(share(8), 1.2);  // exp(−n/.97)
}

TEST(LayerError, HasTheProfilesOfTheMeshAsItCame) {
  const HighOrderMesh came = make({Shape::Quadrilateral, 3, 9, 0.1, 1, Inside::Parallel});
  HighOrderMesh mesh = came;  // with a first layer of half the height
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    double* const x = &mesh.coordinates[3 * node];
    const double radius = std::hypot(x[0], x[1]), height = 0.9 * std::pow(std::max(0.0, radius - 1) / 0.9, 1.3);
    for (std::size_t c = 0; c < 2 && height > 1e-3; ++c) x[c] *= (1 + height) / radius;
  }
  const Team team(2);
  Facets found;
  team.run([&] { found = facets(came, team); });
  const auto before = layer_error(came, found, team), alone = layer_error(mesh, found, team);
  const auto after = layer_error(mesh, found, team, &came);
  ASSERT_TRUE(before && after && alone);
  EXPECT_EQ(before->of_profiles.size(), 5U);
  EXPECT_EQ(after->of_profiles.size(), 5U);
  EXPECT_NE(alone->of_profiles, after->of_profiles) << "its own profiles are thinner";
}

TEST(LayerError, DoesNotDependOnTheDistanceFromTheOrigin) {
  HighOrderMesh mesh = make({Shape::Hexahedron, 2, 6, 1e-4, 2, Inside::Parallel});
  const double before = error_at(mesh);
  for (double& x : mesh.coordinates) x += 1e3;
  EXPECT_NEAR(error_at(mesh), before, 1e-6 * before);  // the coordinates are rounded to 1e-9 of the first layer
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
