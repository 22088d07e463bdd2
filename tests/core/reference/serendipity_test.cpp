// The functions of serendipity cells, at the nodes that only complete cells have.
#include "core/reference/serendipity.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "core/reference/nodes.h"

namespace varimesh::reference {
namespace {

using Function = std::function<double(double, double, double)>;

/// The largest error at the missing nodes if a function is interpolated.
double error_of(Shape shape, int order, const Function& function) {
  const Eigen::MatrixXd& values = serendipity_values(shape, order);
  const Points& at = nodes(shape, order, NodeSet::Equispaced, info(shape).dimension);
  const auto f = [&](Eigen::Index i) { return function(at(i, 0), at(i, 1), at.cols() > 2 ? at(i, 2) : 0); };
  double error = 0;
  for (Eigen::Index i = 0; i < values.rows(); ++i) {
    double sum = 0;
    for (Eigen::Index k = 0; k < values.cols(); ++k) sum += values(i, k) * f(k);
    error = std::max(error, std::abs(sum - f(values.cols() + i)));
  }
  return error;
}

TEST(Serendipity, HasTheKnownNumbersOfNodes) {
  EXPECT_EQ(serendipity_node_count(Shape::Quadrilateral, 2), 8);
  EXPECT_EQ(serendipity_node_count(Shape::Quadrilateral, 3), 12);
  EXPECT_EQ(serendipity_node_count(Shape::Hexahedron, 2), 20);
  EXPECT_EQ(serendipity_node_count(Shape::Hexahedron, 3), 32);
  EXPECT_EQ(serendipity_node_count(Shape::Hexahedron, 4), 44);
  EXPECT_EQ(serendipity_node_count(Shape::Prism, 2), 15);
  EXPECT_EQ(serendipity_node_count(Shape::Pyramid, 2), 13);
  EXPECT_EQ(serendipity_node_count(Shape::Triangle, 3), 9);
  for (const auto& [shape, order] : {std::pair(Shape::Hexahedron, 1),
                                     {Shape::Triangle, 2},
                                     {Shape::Tetrahedron, 2},
                                     {Shape::Tetrahedron, 4},
                                     {Shape::Prism, 3},
                                     {Shape::Pyramid, 3},
                                     {Shape::Line, 4}})
    EXPECT_EQ(serendipity_node_count(shape, order), 0);
}

TEST(Serendipity, HoldsTheFunctionsOfTheCell) {
  for (int order = 2; order <= 9; ++order) {
    const auto power = [order](double x) { return std::pow(x, order); };
    for (const Shape shape : {Shape::Quadrilateral, Shape::Hexahedron}) {
      EXPECT_LT(error_of(shape, order, [&](double x, double y, double) { return power(x) * y + power(y) * x; }), 1e-12);
      EXPECT_GT(error_of(shape, order, [](double x, double y, double) { return x * x * y * y; }), 0.1)
          << "which the complete cell holds";
    }
    EXPECT_LT(error_of(Shape::Hexahedron, order, [&](double x, double y, double z) { return power(z) * x * y; }),
              1e-12);
  }
  for (int order = 3; order <= 6; ++order)
    for (int i = 0; i <= order; ++i)
      EXPECT_LT(error_of(Shape::Triangle, order,
                         [&](double x, double y, double) {
                           return std::pow((x + 1) / 2, i) * std::pow((y + 1) / 2, order - i);
                         }),
                1e-11);
  for (const Shape shape : {Shape::Prism, Shape::Pyramid}) {
    EXPECT_LT(error_of(shape, 2, [](double x, double y, double z) { return 1 + x * y - 2 * y * z + x * x; }), 1e-12);
    EXPECT_LT(error_of(shape, 2, [](double x, double y, double z) { return z * z + y * y - 3 * x; }), 1e-12);
  }
}

// Two cells with a common face complete it alike.
TEST(Serendipity, OfAFaceIsThatOfTheCell) {
  for (const auto& [shape, order] :
       {std::pair(Shape::Hexahedron, 2), {Shape::Hexahedron, 5}, {Shape::Prism, 2}, {Shape::Pyramid, 2}})
    for (std::size_t face = 0; face < info(shape).faces.size(); ++face) {
      if (info(shape).faces[face].shape != Shape::Quadrilateral) continue;
      const std::vector<int>& on_face = facet_nodes(shape, order, int(face));
      const Eigen::MatrixXd &cell = serendipity_values(shape, order),
                            &plane = serendipity_values(Shape::Quadrilateral, order);
      for (Eigen::Index i = 0; i < plane.rows(); ++i)
        for (Eigen::Index k = 0; k < plane.cols(); ++k)
          EXPECT_NEAR(cell(on_face[std::size_t(plane.cols() + i)] - cell.cols(), on_face[std::size_t(k)]), plane(i, k),
                      1e-13);
    }
}

}  // namespace
}  // namespace varimesh::reference
