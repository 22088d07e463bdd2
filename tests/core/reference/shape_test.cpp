// The table of shapes is consistent: facets are closed, point outward and enclose the stated measure.
#include "core/reference/shape.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <map>

#include "tests/core/reference/common.h"

namespace varimesh::reference {
namespace {

Eigen::Vector3d vertex(const ShapeInfo& cell, int v) { return Eigen::Vector3d(cell.vertex[v].data()); }

TEST(Shape, TheTableIsIndexedByShape) {
  for (int s = 0; s < kShapes; ++s) EXPECT_EQ(static_cast<int>(info(static_cast<Shape>(s)).shape), s);
}

TEST(Shape, FacetsOfVolumesPointOutwardAndEncloseTheMeasure) {
  for (const Shape shape : {Shape::Tetrahedron, Shape::Pyramid, Shape::Prism, Shape::Hexahedron}) {
    const ShapeInfo& cell = info(shape);
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    for (int v = 0; v < cell.vertices; ++v) centre += vertex(cell, v) / cell.vertices;
    double volume = 0;
    for (const Facet& facet : cell.facets) {
      const Eigen::Vector3d a = vertex(cell, facet.vertices[0]);
      for (int v = 1; v + 1 < info(facet.shape).vertices; ++v) {
        const Eigen::Vector3d b = vertex(cell, facet.vertices[v]), c = vertex(cell, facet.vertices[v + 1]);
        const double cone = (b - a).cross(c - a).dot(a - centre) / 6;
        EXPECT_GT(cone, 0) << cell.name;
        volume += cone;
      }
    }
    EXPECT_NEAR(volume, cell.measure, 1e-14) << cell.name;
  }
}

TEST(Shape, EdgesOfPlaneCellsGoRoundCounterClockwise) {
  for (const Shape shape : {Shape::Triangle, Shape::Quadrilateral}) {
    const ShapeInfo& cell = info(shape);
    double area = 0;
    for (const Facet& facet : cell.facets) {
      EXPECT_EQ(facet.shape, Shape::Line);
      const Eigen::Vector3d a = vertex(cell, facet.vertices[0]), b = vertex(cell, facet.vertices[1]);
      area += (a[0] * b[1] - a[1] * b[0]) / 2;
    }
    EXPECT_NEAR(area, cell.measure, 1e-15) << cell.name;
    EXPECT_EQ(cell.faces.size(), 1u);
  }
}

TEST(Shape, FacesPassEveryEdgeOfAVolumeOnceEachWay) {
  for (const Shape shape : {Shape::Tetrahedron, Shape::Pyramid, Shape::Prism, Shape::Hexahedron}) {
    const ShapeInfo& cell = info(shape);
    std::map<std::pair<int, int>, int> passed;
    for (const Facet& facet : cell.facets) {
      const int n = info(facet.shape).vertices;
      for (int v = 0; v < n; ++v) ++passed[{facet.vertices[v], facet.vertices[(v + 1) % n]}];
    }
    EXPECT_EQ(passed.size(), 2 * cell.edges.size()) << cell.name;
    for (const auto& edge : cell.edges) {
      EXPECT_EQ((passed[{edge[0], edge[1]}]), 1) << cell.name;
      EXPECT_EQ((passed[{edge[1], edge[0]}]), 1) << cell.name;
    }
  }
}

TEST(Shape, NodeCountsOfOrderOneAreTheVertices) {
  for (const Shape shape : kCells) EXPECT_EQ(node_count(shape, 1), info(shape).vertices);
  EXPECT_EQ(node_count(Shape::Tetrahedron, 10), 286);
  EXPECT_EQ(node_count(Shape::Pyramid, 9), 385);
}

}  // namespace
}  // namespace varimesh::reference
