// Gmsh's element type numbers.
#include <gtest/gtest.h>

#include "core/formats/gmsh/types.h"
#include "tests/core/support/print.h"

namespace varimesh::formats {
namespace {

TEST(GmshTypes, AreTheKnownNumbers) {
  const std::tuple<Shape, int, int> known[] = {
      {Shape::Point, 1, 15},        {Shape::Line, 1, 1},           {Shape::Line, 2, 8},
      {Shape::Triangle, 1, 2},      {Shape::Triangle, 2, 9},       {Shape::Triangle, 3, 21},
      {Shape::Quadrilateral, 1, 3}, {Shape::Quadrilateral, 2, 10}, {Shape::Tetrahedron, 1, 4},
      {Shape::Tetrahedron, 2, 11},  {Shape::Tetrahedron, 3, 29},   {Shape::Hexahedron, 1, 5},
      {Shape::Hexahedron, 2, 12},   {Shape::Prism, 1, 6},          {Shape::Prism, 2, 13},
      {Shape::Pyramid, 1, 7},       {Shape::Pyramid, 2, 14}};
  for (const auto& [shape, order, number] : known) EXPECT_EQ(gmsh_type_number(shape, order), number);
}

TEST(GmshTypes, StandForTheShapeAndOrderThatTheyAreWrittenFor) {
  for (const Shape shape : {Shape::Line, Shape::Triangle, Shape::Quadrilateral, Shape::Tetrahedron, Shape::Pyramid,
                            Shape::Prism, Shape::Hexahedron})
    for (int order = 1; order <= 9; ++order) {
      const GmshType type = gmsh_type(gmsh_type_number(shape, order));
      EXPECT_EQ(type.kind, GmshType::Kind::Complete);
      EXPECT_EQ(type.shape, shape);
      EXPECT_EQ(type.order, order);
    }
}

TEST(GmshTypes, HaveNoneForOrderTenOfTensorShapes) {
  EXPECT_EQ(gmsh_type_number(Shape::Hexahedron, 10), 0);
  EXPECT_EQ(gmsh_type_number(Shape::Prism, 10), 0);
  EXPECT_EQ(gmsh_type_number(Shape::Pyramid, 10), 0);
  EXPECT_NE(gmsh_type_number(Shape::Tetrahedron, 10), 0);
}

TEST(GmshTypes, TellIncompleteElementsFromUnknownOnes) {
  EXPECT_EQ(gmsh_type(16).kind, GmshType::Kind::Incomplete);
  EXPECT_EQ(gmsh_type(16).shape, Shape::Quadrilateral);
  EXPECT_EQ(gmsh_type(16).order, 2);
  EXPECT_EQ(gmsh_type(77).kind, GmshType::Kind::Unknown);
  EXPECT_NE(why_refused(32), why_refused(77));
  EXPECT_EQ(node_count(gmsh_type(16)), 8);
  EXPECT_EQ(node_count(gmsh_type(17)), 20);
  EXPECT_EQ(node_count(gmsh_type(18)), 15);
  EXPECT_EQ(node_count(gmsh_type(19)), 13);
  EXPECT_EQ(node_count(gmsh_type(32)), 0) << "tetrahedra of order 4";
}

}  // namespace
}  // namespace varimesh::formats
