// One cell cut in two until the answer is clear: cells whose J is known.
#include "core/validity/subdivision.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/core/support/bernstein_cells.h"

namespace varimesh::detail {
namespace {

using testing::Place;
using Answer = Certificate::Answer;

/// J = (ξ + .4)² + (η + .4)² + (ζ + .4)² + c in space, least with c at (−.4, −.4, −.4), inside every reference cell.
HighOrderMesh paraboloid(Shape shape, double c) {
  return testing::one_cell(shape, 3, [=](Place p) {
    const double x = p[0] + 0.4, y = p[1] + 0.4, z = reference::info(shape).dimension == 3 ? p[2] + 0.4 : 0;
    return Place{x * x * x / 3 + x * (y * y + z * z) + c * p[0], p[1], p[2]};
  });
}

class SubdivisionOf : public ::testing::TestWithParam<Shape> {};

INSTANTIATE_TEST_SUITE_P(Shapes, SubdivisionOf, ::testing::ValuesIn(testing::kCellShapes),
                         [](const auto& shape) { return testing::name(shape.param); });

TEST_P(SubdivisionOf, ProvesWhatTheCoefficientsOfTheWholeCellDoNotShow) {
  const HighOrderMesh valid = paraboloid(GetParam(), 0.01), invalid = paraboloid(GetParam(), -0.01);
  const Certificate yes = subdivide(hard_cell(valid, 0), {}), no = subdivide(hard_cell(invalid, 0), {});
  EXPECT_EQ(yes.answer, Answer::Valid);
  EXPECT_GT(yes.lower_bound, 0);
  EXPECT_LE(yes.lower_bound, 0.01);
  EXPECT_EQ(no.answer, Answer::Invalid);
  EXPECT_LT(no.lower_bound, -0.0099);
}

TEST_P(SubdivisionOf, IsUndecidedIfItMayNotCut) {
  CertificateOptions options;
  options.max_cells = 1;
  const HighOrderMesh mesh = paraboloid(GetParam(), 1e-4);
  EXPECT_EQ(subdivide(hard_cell(mesh, 0), options).answer, Answer::Undecided);
  options.max_cells = 4000;
  options.max_depth = 0;
  EXPECT_EQ(subdivide(hard_cell(mesh, 0), options).answer, Answer::Undecided);
}

TEST_P(SubdivisionOf, SharpensBoundsToTheGapAskedFor) {
  const HighOrderMesh mesh = paraboloid(GetParam(), 0.5);
  CertificateOptions options;
  options.gap = 1e-3;
  const Certificate sharp = subdivide(hard_cell(mesh, 0), options);
  // The greatest J is at a vertex of the cell.
  double greatest = 0;
  const reference::ShapeInfo& shape = reference::info(GetParam());
  for (int v = 0; v < shape.vertices; ++v) {
    double j = 0.5;
    for (int c = 0; c < shape.dimension; ++c)
      j += std::pow(shape.vertex[static_cast<std::size_t>(v)][static_cast<std::size_t>(c)] + 0.4, 2);
    greatest = std::max(greatest, j);
  }
  EXPECT_EQ(sharp.answer, Answer::Valid);
  EXPECT_LE(sharp.scaled_jacobian_lower_bound, 0.5 / greatest);
  EXPECT_GE(sharp.scaled_jacobian_lower_bound, 0.5 / greatest - 1e-3);
  EXPECT_LE(sharp.lower_bound, 0.5);
  EXPECT_GE(sharp.upper_bound, greatest * (1 - 1e-12));
}

/// A part with a least and a greatest coefficient, and the error of both.
struct PlainPart {
  double least = 0, greatest = 0, error = 0;
  double lower() const { return least - error; }
  double upper() const { return greatest + error; }
};

TEST(OpenParts, PutsTheLeastProvedBoundFirstAndNotTheLeastCoefficient) {
  OpenParts<PlainPart> parts;
  parts.push({2, 4, 1});
  parts.push({3, 5, 4});  // proves no more than J ≥ −1, although its coefficients are greater
  parts.push({4, 6, 1});
  EXPECT_EQ(parts.lowest().lower(), -1) << "the bound of all parts together";
  EXPECT_EQ(parts.upper(), 9);
  EXPECT_EQ(parts.take_lowest().least, 3) << "the most doubtful part is cut next";
  EXPECT_EQ(parts.lowest().lower(), 1);
  EXPECT_EQ(parts.upper(), 7);
}

TEST(OpenParts, TakeTheHighestByItsErrorTooAndKeepTheirOrder) {
  OpenParts<PlainPart> parts;
  for (const PlainPart& part : {PlainPart{1, 7, 0.5}, PlainPart{2, 6, 3}, PlainPart{0, 2, 0.25}, PlainPart{3, 3, 2}})
    parts.push(part);
  EXPECT_EQ(parts.take_highest().greatest, 6);
  EXPECT_EQ(parts.take_lowest().lower(), -0.25);
  EXPECT_EQ(parts.take_lowest().lower(), 0.5);
  EXPECT_EQ(parts.take_lowest().lower(), 1);
}

TEST(SetBounds, GoOutwardsInTheFilesUnit) {
  const HighOrderMesh mesh = testing::one_cell(Shape::Tetrahedron, 1, [](Place p) { return p; });
  CellToCertify cell = hard_cell(mesh, 0);
  cell.scale = 0.5;
  Certificate certificate;
  set_bounds(cell, 1, 4, 2, certificate);
  EXPECT_LT(certificate.lower_bound, 8);
  EXPECT_NEAR(certificate.lower_bound, 8, 1e-14) << "(1/2)⁻³ times as much";
  EXPECT_GT(certificate.upper_bound, 32);
  EXPECT_NEAR(certificate.upper_bound, 32, 1e-13);
  EXPECT_LT(certificate.scaled_jacobian_lower_bound, 0.25);
  EXPECT_NEAR(certificate.scaled_jacobian_lower_bound, 0.25, 1e-15) << "a positive minimum over the upper bound";
  set_bounds(cell, -1, 4, 2, certificate);
  EXPECT_NEAR(certificate.scaled_jacobian_lower_bound, -0.5, 1e-15) << "a negative one over what max J is at least";
  set_bounds(cell, -3, -1, -1, certificate);
  EXPECT_EQ(certificate.scaled_jacobian_lower_bound, -1) << "J is positive nowhere";
}

}  // namespace
}  // namespace varimesh::detail
