// Compares the answers from polygons with those of OpenCASCADE's classifier, on faces with holes, seams and splines.
#include "core/opencascade/face_interior.h"

#include <gtest/gtest.h>

#include <BRepAdaptor_Surface.hxx>
#include <BRepAlgoAPI_Cut.hxx>
#include <BRepBuilderAPI_MakeEdge.hxx>
#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakeWire.hxx>
#include <BRepBuilderAPI_NurbsConvert.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCone.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <BRepPrimAPI_MakeTorus.hxx>
#include <BRepTools.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Vertex.hxx>
#include <TopoDS_Wire.hxx>
#include <cmath>
#include <gp_Circ.hxx>
#include <gp_Pln.hxx>
#include <limits>
#include <random>
#include <thread>

namespace varimesh::cad {
namespace {

using geometry::Range;

/// A face and what FaceInterior is told about it.
struct Bounds {
  TopoDS_Face face;
  Range u, v;
  double u_period, v_period;
  explicit Bounds(const TopoDS_Shape& shape) : face(TopoDS::Face(shape)) {
    BRepTools::UVBounds(face, u.first, u.last, v.first, v.last);
    const BRepAdaptor_Surface surface(face, false);
    u_period = surface.IsUPeriodic() ? surface.UPeriod() : 0;
    v_period = surface.IsVPeriodic() ? surface.VPeriod() : 0;
  }
  FaceInterior interior() const { return {face, u, v, u_period, v_period}; }
};

/// A ball of radius 2 with a hole through its poles and one through its seam, as it is or as splines.
TopoDS_Shape bored_ball() {
  const TopoDS_Shape ball = BRepPrimAPI_MakeSphere(2).Shape();
  const gp_Ax2 up(gp_Pnt(0, 0, -3), gp_Dir(0, 0, 1)), through_seam(gp_Pnt(0.5, 0.1, 0.3), gp_Dir(1, 0, 0));
  const TopoDS_Shape bored = BRepAlgoAPI_Cut(ball, BRepPrimAPI_MakeCylinder(up, 0.4, 6).Shape()).Shape();
  return BRepAlgoAPI_Cut(bored, BRepPrimAPI_MakeCylinder(through_seam, 0.5, 3).Shape()).Shape();
}
TopoDS_Shape bored_plate() {
  const gp_Ax2 axis(gp_Pnt(2, 2, -1), gp_Dir(0, 0, 1));
  return BRepAlgoAPI_Cut(BRepPrimAPI_MakeBox(4, 4, 1).Shape(), BRepPrimAPI_MakeCylinder(axis, 1, 3).Shape()).Shape();
}
TopoDS_Shape cut_torus() {
  return BRepAlgoAPI_Cut(BRepPrimAPI_MakeTorus(2, 0.6).Shape(), BRepPrimAPI_MakeCone(2.2, 1.6, 2).Shape()).Shape();
}

class FaceInteriorOf : public testing::TestWithParam<const char*> {
 protected:
  static TopoDS_Shape shape(const std::string& name) {
    const TopoDS_Shape shape = name.starts_with("plate")  ? bored_plate()
                               : name.starts_with("ball") ? bored_ball()
                                                          : cut_torus();
    return name.ends_with("splines") ? BRepBuilderAPI_NurbsConvert(shape).Shape() : shape;
  }
};

TEST_P(FaceInteriorOf, GivesTheAnswersOfTheClassifier) {
  int inside = 0, outside = 0;
  for (TopExp_Explorer faces(shape(GetParam()), TopAbs_FACE); faces.More(); faces.Next()) {
    const Bounds bounds(faces.Current());
    const FaceInterior interior = bounds.interior();
    BRepTopAdaptor_FClass2d classifier(bounds.face, BRep_Tool::Tolerance(bounds.face));
    std::mt19937 random(24);
    std::uniform_int_distribution<int> turns(-2, 2);
    int others = 0;
    const auto compare = [&](double u, double v) {
      u += turns(random) * bounds.u_period;
      v += turns(random) * bounds.v_period;
      const bool is_inside = classifier.Perform(gp_Pnt2d(u, v)) != TopAbs_OUT;
      others += interior.contains(u, v) == is_inside ? 0 : 1;
      (is_inside ? inside : outside) += 1;
    };
    std::uniform_real_distribution<double> part(-0.1, 1.1);
    for (int k = 0; k < 5'000; ++k)
      compare(bounds.u.first + part(random) * bounds.u.length(), bounds.v.first + part(random) * bounds.v.length());
    // Near the boundary, at distances from a millionth to a thirtieth of the ranges.
    std::uniform_real_distribution<double> along(0, 1), exponent(-6, -1.5), side(-1, 1);
    const TopoDS_Face forward = TopoDS::Face(bounds.face.Oriented(TopAbs_FORWARD));
    for (TopExp_Explorer edges(forward, TopAbs_EDGE); edges.More(); edges.Next()) {
      double first = 0, last = 0;
      const auto curve = BRep_Tool::CurveOnSurface(TopoDS::Edge(edges.Current()), forward, first, last);
      for (int k = 0; k < 800; ++k) {
        const gp_Pnt2d on = curve->Value(first + along(random) * (last - first));
        const double off = std::pow(10, exponent(random));
        compare(on.X() + off * side(random) * bounds.u.length(), on.Y() + off * side(random) * bounds.v.length());
      }
    }
    EXPECT_EQ(others, 0);
    EXPECT_TRUE(interior.has_outline());
  }
  EXPECT_GT(inside, 1000);
  EXPECT_GT(outside, 1000);
}

INSTANTIATE_TEST_SUITE_P(Shapes, FaceInteriorOf,
                         testing::Values("plate", "plate_of_splines", "ball", "ball_of_splines", "torus",
                                         "torus_of_splines"),
                         [](const auto& each) { return std::string(each.param); });

TopoDS_Wire circle(double x, double y, double radius) {
  const gp_Circ circle(gp_Ax2(gp_Pnt(x, y, 0), gp_Dir(0, 0, -1)), radius);
  return BRepBuilderAPI_MakeWire(BRepBuilderAPI_MakeEdge(circle)).Wire();
}

/// Expects the classifier's answers at random points, and says whether there is an outline.
bool has_outline_and_agrees(const TopoDS_Face& face) {
  const Bounds bounds(face);
  const FaceInterior interior = bounds.interior();
  BRepTopAdaptor_FClass2d classifier(face, BRep_Tool::Tolerance(face));
  std::mt19937 random(3);
  std::uniform_real_distribution<double> part(-0.1, 1.1);
  int others = 0;
  for (int k = 0; k < 20'000; ++k) {
    const double u = bounds.u.first + part(random) * bounds.u.length();
    const double v = bounds.v.first + part(random) * bounds.v.length();
    others += interior.contains(u, v) == (classifier.Perform(gp_Pnt2d(u, v)) != TopAbs_OUT) ? 0 : 1;
  }
  EXPECT_EQ(others, 0);
  return interior.has_outline();
}

TopoDS_Face plate(const std::vector<TopoDS_Wire>& holes) {
  BRepBuilderAPI_MakeFace face(gp_Pln(), 0, 4, 0, 4);
  for (const TopoDS_Wire& hole : holes) face.Add(hole);
  return face.Face();
}

// The number of sides that a ray crosses says nothing where holes overlap.
TEST(FaceInterior, HasNoOutlineIfWiresOverlap) {
  EXPECT_TRUE(has_outline_and_agrees(plate({circle(1, 2, 0.5), circle(3, 2, 0.5)})));
  EXPECT_FALSE(has_outline_and_agrees(plate({circle(1.6, 1.7, 0.41), circle(2.4, 1.7, 0.41)})));
  EXPECT_FALSE(has_outline_and_agrees(plate({circle(0.4, 1.7, 0.5)})));
}

TEST(FaceInterior, HasNoOutlineIfAToleranceIsLarge) {
  for (const double tolerance : {1.0, std::numeric_limits<double>::infinity()}) {
    const TopoDS_Face face = plate({});
    TopExp_Explorer vertices(face, TopAbs_VERTEX);
    BRep_Builder().UpdateVertex(TopoDS::Vertex(vertices.Current()), tolerance);
    const FaceInterior interior = Bounds(face).interior();
    for (int k = 0; k < 100; ++k) interior.contains(0.04 * k, 2);
    EXPECT_FALSE(interior.has_outline());
  }
}

TEST(FaceInterior, ThreadsMayShareIt) {
  const TopoDS_Shape plate = bored_plate();
  for (TopExp_Explorer faces(plate, TopAbs_FACE); faces.More(); faces.Next()) {
    const Bounds bounds(faces.Current());
    const FaceInterior shared = bounds.interior(), own = bounds.interior();
    const auto count = [&](const FaceInterior& interior) {
      int count = 0;
      for (int i = 0; i < 100; ++i)
        for (int j = 0; j < 100; ++j)
          count += interior.contains(bounds.u.first + (i + 0.5) / 100 * bounds.u.length(),
                                     bounds.v.first + (j + 0.5) / 100 * bounds.v.length())
                       ? 1
                       : 0;
      return count;
    };
    std::array<int, 4> counts{};
    std::vector<std::thread> threads;
    for (int& each : counts) threads.emplace_back([&] { each = count(shared); });
    for (std::thread& thread : threads) thread.join();
    const int expected = count(own);
    for (const int found : counts) EXPECT_EQ(found, expected);
  }
}

}  // namespace
}  // namespace varimesh::cad
