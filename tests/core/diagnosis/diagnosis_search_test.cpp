// Cells that a point condition calls unrepairable, confirmed by an independent search: wherever the free nodes go, the
// cell stays invalid. For a similar cell that is not called unrepairable, the search finds a valid place.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "core/diagnosis/diagnose.h"
#include "core/quality/quality.h"
#include "core/validity/certificate.h"
#include "tests/core/support/made_cells.h"

namespace varimesh {
namespace {

using testing::Place;
using Kind = UnrepairableGroup::Kind;

/// One cell, and which of its nodes are fixed.
struct HeldCell {
  HighOrderMesh mesh;
  std::vector<bool> fixed;
};

/// A cell with its nodes placed by `map`. `held` says by reference coordinates which nodes are fixed.
HeldCell held_cell(Shape shape, int order, const std::function<Place(Place)>& map,
                   const std::function<bool(Place)>& held) {
  HeldCell cell;
  cell.mesh = testing::one_cell(shape, order, [&](Place p) {
    cell.fixed.push_back(held(p));
    return map(p);
  });
  return cell;
}

/// Whether hill climbing on the worst sampled J, from many starts, ends in a cell that is certified valid. Samples can
/// miss a line where J is 0. The certificate cannot.
bool search_finds_a_valid_cell(HeldCell cell, int starts) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  const auto d = static_cast<std::size_t>(cell.mesh.dimension);
  const int intervals = 2 * cell.mesh.order;
  const std::vector<double> begin = cell.mesh.coordinates;
  const auto worst = [&] { return cell_quality(cell.mesh, intervals, 1).scaled_jacobian[0]; };
  for (int start = 0; start < starts; ++start) {
    cell.mesh.coordinates = begin;
    const auto shake = [&](double amount) {
      for (std::size_t n = 0; n < cell.fixed.size(); ++n)
        for (std::size_t c = 0; c < d; ++c)
          if (!cell.fixed[n]) cell.mesh.coordinates[3 * n + c] += amount * normal(random);
    };
    shake(0.05 * start);
    double here = worst();
    for (double step = 0.2; step > 1e-3; step *= 0.97) {
      const std::vector<double> before = cell.mesh.coordinates;
      shake(step);
      const double there = worst();
      if (there > here)
        here = there;
      else
        cell.mesh.coordinates = before;
    }
    if (certify(cell.mesh, {}, 1)[0].is_valid()) return true;
  }
  return false;
}

std::vector<Kind> kinds(const HeldCell& cell) {
  std::vector<Kind> found;
  for (const UnrepairableGroup& group : diagnose(cell.mesh, cell.fixed, Team(1))) found.push_back(group.kind);
  return found;
}

/// The cell is called unrepairable, and no search makes it valid.
void expect_confirmed(const HeldCell& cell, Kind kind) {
  ASSERT_TRUE(std::ranges::count(cell.fixed, false) > 0);
  EXPECT_TRUE(std::ranges::count(kinds(cell), kind) > 0);
  EXPECT_FALSE(search_finds_a_valid_cell(cell, 12));
}

/// The cell is not called unrepairable, and a search makes it valid from a tangled start.
void expect_repairable(HeldCell cell) {
  EXPECT_TRUE(kinds(cell).empty());
  EXPECT_TRUE(search_finds_a_valid_cell(std::move(cell), 12));
}

bool near(double a, double b) { return std::abs(a - b) < 1e-9; }

/// Whether a node is on an edge of a tetrahedron at its first vertex.
bool on_edges_at_first_vertex(Place p) { return (near(p[0], -1) + near(p[1], -1) + near(p[2], -1)) >= 2; }

TEST(DiagnosisSearch, EdgesInOnePlane) {
  const auto cell = [](double height) {
    // The edge along the third axis leaves the first vertex at this height above the plane of the other two edges.
    return held_cell(
        Shape::Tetrahedron, 3,
        [=](Place p) {
          const double t = p[2] + 1;
          return Place{p[0] + 0.8 * t * (2 - t), p[1] + 0.8 * t * (2 - t), p[2] + (height - 1) * t * (2 - t) / 2};
        },
        on_edges_at_first_vertex);
  };
  expect_confirmed(cell(-0.05), Kind::Vertex);
  expect_repairable(cell(0.5));
}

TEST(DiagnosisSearch, TheEdgeBetweenTwoFixedFaces) {
  const auto cell = [](double fold) {
    return held_cell(
        Shape::Tetrahedron, 4,
        [=](Place p) {
          const double t = p[0] + 1;
          return Place{p[0], (p[1] + 1) * (1 - fold * t * (2 - t)), p[2] + 1};
        },
        [](Place p) { return near(p[1], -1) || near(p[2], -1); });
  };
  expect_confirmed(cell(1.2), Kind::Edge);
  expect_repairable(cell(0.6));
}

TEST(DiagnosisSearch, ACellWithOneFreeNode) {
  // A quadratic tetrahedron with one free node, in the middle of an edge. At some points of the opposite edge J does
  // not depend on it, so only fixed nodes decide there.
  const auto cell = [](double fold) {
    return held_cell(
        Shape::Tetrahedron, 2,
        [=](Place p) {
          const double t = p[0] + 1;
          return Place{p[0], (p[1] + 1) * (1 - fold * t * (2 - t)), p[2] + 1};
        },
        [](Place p) { return !(near(p[0], -1) && near(p[1], 0) && near(p[2], 0)); });
  };
  ASSERT_FALSE(kinds(cell(2.5)).empty());
  EXPECT_FALSE(search_finds_a_valid_cell(cell(2.5), 12));
  expect_repairable(cell(0.4));
}

TEST(DiagnosisSearch, AFlatFaceThatFolds) {
  const auto cell = [](double by) {
    return held_cell(
        Shape::Tetrahedron, 2,
        [=](Place p) {
          if (near(p[0], 0) && near(p[1], -1) && near(p[2], -1)) p[1] += by;  // within the plane of the face
          return p;
        },
        [](Place p) { return near(p[2], -1); });
  };
  expect_confirmed(cell(1.2), Kind::FoldedFace);
  expect_repairable(cell(0.2));
}

TEST(DiagnosisSearch, AStraightEdgeThatFolds) {
  const auto cell = [](double by) {
    return held_cell(
        Shape::Triangle, 3,
        [=](Place p) {
          if (near(p[1], -1) && !near(p[0], -1) && !near(p[0], 1)) p[0] += by;
          return p;
        },
        [](Place p) { return near(p[1], -1); });
  };
  expect_confirmed(cell(1.5), Kind::FoldedFace);
  expect_repairable(cell(0.1));
}

TEST(DiagnosisSearch, TheCornerOfAQuadrilateral) {
  const auto cell = [](double lean) {
    return held_cell(
        Shape::Quadrilateral, 3,
        [=](Place p) {
          const double t = p[1] + 1;
          if (near(p[0], -1)) p = {p[0] + lean * t * (2 - t), p[1] - 0.9 * std::abs(lean) * t * (2 - t), 0};
          return p;
        },
        [](Place p) { return near(p[0], -1) || near(p[1], -1); });
  };
  expect_confirmed(cell(0.6), Kind::Vertex);
  expect_repairable(cell(0.2));
}

}  // namespace
}  // namespace varimesh
