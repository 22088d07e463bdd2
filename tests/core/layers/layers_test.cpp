// Layers along a quarter of a cylinder: where their nodes lie is known.
#include "core/layers/layers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/base/index.h"
#include "core/optimise/optimiser.h"
#include "tests/core/layers/layer_meshes.h"
#include "tests/core/support/cases.h"

namespace varimesh {
namespace {

class OfShape : public ::testing::TestWithParam<std::tuple<Shape, int>> {
 protected:
  Layers layers(double first, double growth, int count, Inside inside) const {
    return {std::get<0>(GetParam()), std::get<1>(GetParam()), count, first, growth, inside};
  }
};

TEST_P(OfShape, KeepsNodesThatLieOnParallelSurfaces) {
  const HighOrderMesh mesh = make(layers(1e-3, 2.2, 8, Inside::Parallel));
  ASSERT_EQ(uncertified(mesh, mesh.coordinates), 0);
  const LayerStart started = start(mesh);
  EXPECT_TRUE(started.coordinates.empty());
  EXPECT_EQ(started.placed, 0);
  EXPECT_EQ(static_cast<std::size_t>(started.cells), mesh.element_count(mesh.dimension));
  EXPECT_EQ(std::ranges::count(started.held, 1), static_cast<std::ptrdiff_t>(mesh.node_count()));
}

/// Only the wall is curved, and it cuts through layers of any thickness.
TEST_P(OfShape, PlacesNodesOnParallelSurfaces) {
  for (const auto& [first, growth] : {std::pair{1e-2, 1.6}, {1e-5, 4.2}, {1e-9, 16.0}}) {
    const Layers straight = layers(first, growth, 8, Inside::StraightSided);
    Layers faded = straight;
    faded.inside = Inside::Faded;
    const HighOrderMesh mesh = make(straight), wanted = make(faded);
    ASSERT_GT(uncertified(mesh, mesh.coordinates), 0);
    const LayerStart started = start(mesh);
    ASSERT_EQ(started.coordinates.size(), mesh.coordinates.size());
    EXPECT_EQ(uncertified(mesh, started.coordinates), 0) << first;
    EXPECT_GT(started.made_valid, 0);
    // On the ends and on top, boundary nodes stay where they are.
    const std::vector<bool> fixed = fixed_nodes(mesh);
    double farthest = 0;
    for (std::size_t node = 0; node < mesh.node_count(); ++node)
      for (std::size_t c = 0; c < 3; ++c) {
        const std::size_t k = 3 * node + c;
        if (fixed[node])
          EXPECT_EQ(started.coordinates[k], mesh.coordinates[k]);
        else
          farthest = std::max(farthest, std::abs(started.coordinates[k] - wanted.coordinates[k]));
      }
    // The wall is a polynomial of order P through points of the cylinder. For P = 2 its normals are off by up to .005.
    EXPECT_LT(farthest, 0.01 * straight.height(straight.count)) << first;
  }
}

// On top, nodes are away from the parallel surface by as much as the threshold. If those counted that are farther away,
// and the others not, the nodes between would not lie on a smooth surface.
TEST(Layers, FadeSmoothlyToATopThatIsHardlyAway) {
  const Layers straight{Shape::Quadrilateral, 5, 6, 1e-2, 1.6, Inside::StraightSided};
  Layers parallel = straight;
  parallel.inside = Inside::Parallel;
  HighOrderMesh mesh = make(straight);
  const HighOrderMesh wanted = make(parallel);
  const double below = 1 + straight.height(5), top = 1 + straight.height(6), step = std::acos(-1.0) / 2 / kAround;
  /// How far the node is to be above the parallel surface.
  const auto away = [&](std::size_t node) {
    const double *x = &wanted.coordinates[3 * node], radius = std::hypot(x[0], x[1]);
    const double part = std::abs(std::remainder(std::atan2(x[0], x[1]), step)) / step;  // at most 1/2
    const double at_top = part < 0.1 ? 0 : (part < 0.3 ? 0.8e-3 : 1.2e-3) * (top - below);
    return std::max(0.0, (radius - below) / (top - below)) * at_top;
  };
  const auto is_on_top = [&](std::size_t node) {
    return std::hypot(wanted.coordinates[3 * node], wanted.coordinates[3 * node + 1]) > top - 1e-9;
  };
  const auto raised = [&](std::size_t node, std::size_t c) {
    const double *x = &wanted.coordinates[3 * node], radius = std::hypot(x[0], x[1]);
    return x[c] * (1 + away(node) / radius);
  };
  for (std::size_t node = 0; node < mesh.node_count(); ++node)
    for (std::size_t c = 0; c < 2; ++c)
      if (is_on_top(node)) mesh.coordinates[3 * node + c] = raised(node, c);
  const LayerStart started = start(mesh);
  ASSERT_EQ(started.placed, started.cells);
  const std::vector<bool> fixed = fixed_nodes(mesh);
  for (std::size_t node = 0; node < mesh.node_count(); ++node)
    for (std::size_t c = 0; c < 2 && !fixed[node]; ++c)
      EXPECT_NEAR(started.coordinates[3 * node + c], raised(node, c), 1e-4 * (top - below)) << node;
}

std::string name_of(const ::testing::TestParamInfo<std::tuple<Shape, int>>& info) {
  return std::string(reference::info(std::get<0>(info.param)).name) + "_p" + std::to_string(std::get<1>(info.param));
}

INSTANTIATE_TEST_SUITE_P(Flat, OfShape,
                         ::testing::Combine(::testing::Values(Shape::Quadrilateral, Shape::Triangle),
                                            ::testing::Values(2, 3, 4, 5)),
                         name_of);
INSTANTIATE_TEST_SUITE_P(Solid, OfShape,
                         ::testing::Combine(::testing::Values(Shape::Hexahedron, Shape::Prism, Shape::Tetrahedron),
                                            ::testing::Values(2, 3)),
                         name_of);

TEST(Layers, AreNotFoundAtAFlatWall) {
  Layers flat{Shape::Quadrilateral, 3, 6, 1e-3, 1.6, Inside::Parallel, false};
  EXPECT_TRUE(start(make(flat)).held.empty());
}

TEST(Layers, AreNotFoundIfCellsAreAsHighAsWide) {
  EXPECT_TRUE(start(make({Shape::Quadrilateral, 3, 3, 0.3, 1, Inside::Parallel})).held.empty());
}

/// Turns nodes about the axis of the cylinder, so that the facets in the middle of the wall are shorter than the
/// others.
void narrow_the_middle(HighOrderMesh& mesh, double by) {
  for (std::size_t k = 0; k < mesh.coordinates.size(); k += 3) {
    double &x = mesh.coordinates[k], &y = mesh.coordinates[k + 1];
    const double radius = std::hypot(x, y), angle = std::atan2(x, y), turned = angle + by * std::sin(4 * angle);
    x = radius * std::sin(turned);
    y = radius * std::cos(turned);
  }
}

/// The nose of a body has shorter facets than its sides. Layers that are thin at the sides are layers there too.
TEST(Layers, AreFoundWhereShortFacetsOfAWallMakeThemHigh) {
  for (const Shape shape : {Shape::Quadrilateral, Shape::Triangle}) {
    HighOrderMesh mesh = make({shape, 3, 8, 0.1, 1.2, Inside::Parallel});
    narrow_the_middle(mesh, 0.12);
    ASSERT_EQ(uncertified(mesh, mesh.coordinates), 0);
    const LayerStart started = start(mesh);
    EXPECT_TRUE(started.coordinates.empty());
    EXPECT_EQ(static_cast<std::size_t>(started.cells), mesh.element_count(2));
    EXPECT_EQ(std::ranges::count(started.held, 1), static_cast<std::ptrdiff_t>(mesh.node_count()));
  }
}

/// A wall on which few cells are thin has no layers elsewhere.
TEST(Layers, AreNotFoundBesideAFewThinCells) {
  HighOrderMesh mesh = make({Shape::Quadrilateral, 3, 3, 0.2, 1, Inside::Parallel});
  narrow_the_middle(mesh, -0.12);
  const LayerStart started = start(mesh);
  EXPECT_GT(started.cells, 0);
  EXPECT_LT(static_cast<std::size_t>(started.cells), mesh.element_count(2));
}

/// Nodes of a valid mesh are held only where they lie on parallel surfaces.
TEST(Layers, LeaveUnevenCellsOfAValidMeshToTheRun) {
  HighOrderMesh mesh = make({Shape::Quadrilateral, 3, 8, 1e-2, 1.7, Inside::Parallel});
  const std::vector<bool> fixed = fixed_nodes(mesh);
  const std::vector<std::int32_t>& nodes = mesh.blocks[0].nodes;
  const std::size_t inside = at(nodes[16 * 16 + 12]);  // the first inner node of a cell away from the ends
  ASSERT_FALSE(fixed[inside]);
  mesh.coordinates[3 * inside] += 1e-3;
  ASSERT_EQ(uncertified(mesh, mesh.coordinates), 0);
  const LayerStart started = start(mesh);
  EXPECT_TRUE(started.coordinates.empty());
  EXPECT_EQ(started.held[inside], 0);
  EXPECT_GT(std::ranges::count(started.held, 1), 0);
}

TEST(Layers, OfAValidMeshStayInADefaultRun) {
  const HighOrderMesh mesh = make({Shape::Quadrilateral, 3, 8, 1e-3, 2.2, Inside::Parallel});
  const auto result = optimise(mesh);
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->mesh.coordinates, mesh.coordinates);
  EXPECT_TRUE(result->after.uncertified.empty());
}

/// Columns of vertices go on by chance through some of the triangles around ten layers of quadrilaterals.
TEST(Layers, EndWhereCellsOfAnotherShapeBegin) {
  const HighOrderMesh mesh = testing::read_case("ellipse_layers_p2.msh");
  const LayerStart started = start(mesh);
  EXPECT_EQ(started.cells, 200);
  EXPECT_EQ(started.placed, 200);
  const auto result = optimise(mesh);
  ASSERT_TRUE(result.has_value());
  EXPECT_TRUE(result->after.uncertified.empty());
  EXPECT_GT(result->after.min_scaled_jacobian, 0.6);
}

TEST(Layers, ThinnerThanTheWallBendsComeOutValid) {
  for (const Shape shape : {Shape::Quadrilateral, Shape::Triangle}) {
    const HighOrderMesh mesh = make({shape, 4, 12, 1e-8, 4.8, Inside::StraightSided});
    ASSERT_GT(uncertified(mesh, mesh.coordinates), 0);
    const auto result = optimise(mesh);
    ASSERT_TRUE(result.has_value());
    EXPECT_FALSE(result->before.uncertified.empty());
    EXPECT_TRUE(result->after.uncertified.empty());
    EXPECT_NE(result->notes.size(), 0U);
  }
}

/// In a geometric progression of heights with the growth g, a node at the share ξ of its layer is at the share
/// (g^.6ξ − 1)/(g^.6 − 1) of the height.
TEST(Layers, AreGradedAsTheirHeightsGrow) {
  for (const Shape shape : {Shape::Quadrilateral, Shape::Triangle})
    for (const bool bends : {true, false}) {
      const Layers even{shape, 3, 8, 1e-3, 1.9, Inside::Parallel, bends};
      const HighOrderMesh mesh = make(even);
      const LayerStart started = start(mesh, LayerSpacing::Graded);
      ASSERT_EQ(started.coordinates.size(), mesh.coordinates.size());
      EXPECT_EQ(uncertified(mesh, started.coordinates), 0);
      const std::vector<bool> fixed = fixed_nodes(mesh);
      const auto distance = [&](const std::vector<double>& x, std::size_t node) {
        return bends ? std::hypot(x[3 * node], x[3 * node + 1]) - 1 : x[3 * node + 1];
      };
      std::size_t graded = 0;
      const double step = std::acos(-1.0) / 2 / kAround;
      for (std::size_t node = 0; node < mesh.node_count(); ++node) {
        const double* x = &mesh.coordinates[3 * node];
        const double along = (bends ? std::atan2(x[0], x[1]) : x[0]) / step;
        const double came = distance(mesh.coordinates, node), is = distance(started.coordinates, node);
        if (fixed[node] && along > 0.01 && along < kAround - 0.01) {  // on the wall, or at the top
          EXPECT_EQ(is, came);
          continue;
        }
        if (came > even.height(4)) continue;
        int layer = 0;
        while (even.height(layer + 1) < came * (1 - 1e-9)) ++layer;
        const double height = even.height(layer + 1) - even.height(layer);
        const double level = layer + (came - even.height(layer)) / height;
        const double rate = 0.6 * std::log(even.growth);
        const double wanted = even.height(layer) + height * std::expm1(rate * (level - layer)) / std::expm1(rate);
        EXPECT_NEAR(is, wanted, 1e-2 * height) << reference::info(shape).name << bends;
        graded += std::abs(wanted - came) > 0.03 * height ? 1 : 0;
      }
      EXPECT_GT(graded, 20U);
    }
}

/// Nodes that lie on parallel surfaces move by the change of their spacing and nothing else, although the wall is a
/// polynomial that bends otherwise than these surfaces.
TEST(Layers, ThatAreGradedBecomeEvenAgain) {
  for (const Layers& layers : {Layers{Shape::Hexahedron, 2, 6, 1e-3, 2, Inside::Parallel},
                               Layers{Shape::Quadrilateral, 4, 6, 1e-3, 1.5, Inside::Parallel}}) {
    const HighOrderMesh mesh = make(layers);
    HighOrderMesh graded = mesh;
    graded.coordinates = start(mesh, LayerSpacing::Graded).coordinates;
    ASSERT_EQ(graded.coordinates.size(), mesh.coordinates.size());
    const LayerStart even = start(graded, LayerSpacing::Even);
    ASSERT_EQ(even.coordinates.size(), mesh.coordinates.size());
    double most = 0, moved = 0;
    for (std::size_t k = 0; k < mesh.coordinates.size(); ++k) {
      most = std::max(most, std::abs(even.coordinates[k] - mesh.coordinates[k]));
      moved = std::max(moved, std::abs(graded.coordinates[k] - mesh.coordinates[k]));
    }
    EXPECT_LT(most, 1e-3 * moved);
  }
}

/// The run compares its mesh with the graded one, whose scaled Jacobian is lower than that of the mesh as it came.
TEST(Layers, StayGradedInARun) {
  const HighOrderMesh mesh = make({Shape::Quadrilateral, 3, 8, 1e-3, 1.9, Inside::Parallel});
  Options options;
  options.layer_spacing = LayerSpacing::Graded;
  const auto result = optimise(mesh, options);
  ASSERT_TRUE(result.has_value());
  EXPECT_TRUE(result->after.uncertified.empty());
  const std::vector<double> graded = start(mesh, LayerSpacing::Graded).coordinates;
  std::size_t same = 0;
  for (std::size_t k = 0; k < graded.size(); ++k)
    same += graded[k] != mesh.coordinates[k] && result->mesh.coordinates[k] == graded[k] ? 1 : 0;
  EXPECT_GT(same, 100U);
}

TEST(Layers, AreToldIfThereAreNone) {
  const HighOrderMesh mesh = make({Shape::Quadrilateral, 3, 3, 0.3, 1, Inside::Parallel});
  Options options;
  options.layer_spacing = LayerSpacing::Even;
  const auto result = optimise(mesh, options);
  ASSERT_TRUE(result.has_value());
  ASSERT_FALSE(result->notes.empty());
  EXPECT_NE(result->notes.front().find("no layers"), std::string::npos);
}

/// An optimiser that is used again finds the layers anew.
TEST(Layers, AreFoundInTheCoordinatesOfEachRun) {
  const Layers straight{Shape::Quadrilateral, 3, 8, 1e-3, 2.2, Inside::StraightSided};
  const HighOrderMesh mesh = make(straight);
  auto optimiser = Optimiser::create(mesh);
  ASSERT_TRUE(optimiser.has_value());
  std::vector<double> turned = mesh.coordinates;
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    turned[3 * node] = -mesh.coordinates[3 * node + 1];
    turned[3 * node + 1] = mesh.coordinates[3 * node];
  }
  HighOrderMesh turned_mesh = mesh;
  turned_mesh.coordinates = turned;
  const auto again = optimiser->run(turned);
  const auto fresh = optimise(turned_mesh);
  ASSERT_TRUE(again.has_value() && fresh.has_value());
  EXPECT_EQ(again->mesh.coordinates, fresh->mesh.coordinates);
  const auto first = optimiser->run(mesh.coordinates);
  ASSERT_TRUE(first.has_value());
  EXPECT_EQ(first->mesh.coordinates, optimise(mesh)->mesh.coordinates);
}

}  // namespace
}  // namespace varimesh
