// Reads files that OpenCASCADE itself has written: bodies with formulas, whose points and areas are known.
#include <fcntl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <BRepAlgoAPI_Cut.hxx>
#include <BRepBuilderAPI_NurbsConvert.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCone.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <BRepPrimAPI_MakeTorus.hxx>
#include <BRepTools.hxx>
#include <BRep_Builder.hxx>
#include <Interface_Static.hxx>
#include <STEPControl_Controller.hxx>
#include <STEPControl_Writer.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS_Compound.hxx>
#include <TopoDS_Shape.hxx>
#include <TopoDS_Shell.hxx>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <thread>

#include "core/geometry/load.h"
#include "tests/core/geometry/conformance.h"

namespace varimesh::geometry {
namespace {

class CadFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("varimesh_cad_" + std::to_string(::getpid()) + "_" +
                                                        testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directory(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string brep(const TopoDS_Shape& shape) const {
    const std::string path = folder_ / "model.brep";
    EXPECT_TRUE(BRepTools::Write(shape, path.c_str()));
    return path;
  }
  std::string step(const TopoDS_Shape& shape) const {
    const std::string path = folder_ / "model.step";
    STEPControl_Writer writer;
    EXPECT_EQ(writer.Transfer(shape, STEPControl_AsIs), IFSelect_RetDone);
    EXPECT_EQ(writer.Write(path.c_str()), IFSelect_RetDone);
    return path;
  }
  std::string text(const std::string& name, const std::string& content) const {
    const std::string path = folder_ / name;
    std::ofstream(path) << content;
    return path;
  }

  std::filesystem::path folder_;
};

/// What every entity of a geometry must fulfil.
void check_all(const Geometry& geometry) {
  const double whole = size(geometry);
  for (const Surface& surface : geometry.surfaces) {
    check_derivatives(*surface.shape, whole);
    check_closest_points(*surface.shape, whole);
    check_seams(*surface.shape, whole);
  }
  for (const Curve& curve : geometry.curves) {
    check_derivatives(*curve.shape, whole);
    check_closest_points(*curve.shape, whole);
    for (const int s : curve.surfaces) {
      const SurfaceSearch search(*geometry.surfaces[static_cast<std::size_t>(s)].shape);
      for (const double t : places_inside(curve.shape->range()))
        EXPECT_LT(search.closest(curve.shape->at(t).x).distance, 1e-6 * whole) << "curve " << curve.tag;
    }
    for (const int v : curve.vertices) {
      const Eigen::Vector3d x = geometry.vertices[static_cast<std::size_t>(v)].x;
      EXPECT_LT(CurveSearch(*curve.shape).closest(x).distance, 1e-6 * whole) << "curve " << curve.tag;
    }
  }
}

TEST_F(CadFile, AnalyticBodiesConform) {
  const std::pair<const char*, TopoDS_Shape> bodies[] = {
      {"box", BRepPrimAPI_MakeBox(1, 2, 3).Shape()},    {"cylinder", BRepPrimAPI_MakeCylinder(1, 3).Shape()},
      {"cone", BRepPrimAPI_MakeCone(2, 1, 3).Shape()},  {"sphere", BRepPrimAPI_MakeSphere(2).Shape()},
      {"torus", BRepPrimAPI_MakeTorus(2, 0.6).Shape()},
  };
  for (const auto& [name, shape] : bodies) {
    SCOPED_TRACE(name);
    const auto geometry = load(brep(shape));
    ASSERT_TRUE(geometry) << geometry.error().sentence;
    check_all(*geometry);
  }
}

TEST_F(CadFile, SplinesConform) {
  const TopoDS_Shape shape = BRepBuilderAPI_NurbsConvert(BRepPrimAPI_MakeTorus(2, 0.6).Shape()).Shape();
  const auto geometry = load(brep(shape));
  ASSERT_TRUE(geometry) << geometry.error().sentence;
  for (const Surface& surface : geometry->surfaces) {
    check_derivatives(*surface.shape, 5);
    check_closest_points(*surface.shape, 5);
    // Each point is on the torus, whose formula is known.
    for (const double u : places_inside(surface.shape->u_range()))
      for (const double v : places_inside(surface.shape->v_range())) {
        const Eigen::Vector3d x = surface.shape->at(u, v).x;
        EXPECT_NEAR(std::hypot(std::hypot(x[0], x[1]) - 2, x[2]), 0.6, 1e-12);
      }
  }
}

TEST_F(CadFile, ATorusIsPeriodicBothWays) {
  const auto geometry = load(brep(BRepPrimAPI_MakeTorus(2, 0.6).Shape()));
  ASSERT_TRUE(geometry) << geometry.error().sentence;
  ASSERT_EQ(geometry->surfaces.size(), 1U);
  EXPECT_GT(geometry->surfaces[0].shape->u_range().period, 6.28);
  EXPECT_GT(geometry->surfaces[0].shape->v_range().period, 6.28);
  for (const Curve& curve : geometry->curves) EXPECT_EQ(curve.surfaces, std::vector<int>({0, 0})) << "a seam";
}

TEST_F(CadFile, ASphereHasPolesAndNoDegenerateCurves) {
  const auto geometry = load(brep(BRepPrimAPI_MakeSphere(2).Shape()));
  ASSERT_TRUE(geometry) << geometry.error().sentence;
  ASSERT_EQ(geometry->curves.size(), 1U) << "only the seam";
  const SurfaceShape& ball = *geometry->surfaces[0].shape;
  EXPECT_EQ(ball.at(0.3, ball.v_range().last).normal(), Eigen::Vector3d::Zero());
}

TEST_F(CadFile, AConeEndsAtItsTip) {
  // The formula of a cone goes on beyond the tip, with a second half. The point (0, 0, 3) is .447 from that half, and
  // farther from the face.
  for (const double top : {0.0, 0.05}) {
    const auto cone = load(brep(BRepPrimAPI_MakeCone(1, top, 2 * (1 - top)).Shape()));
    ASSERT_TRUE(cone) << cone.error().sentence;
    const auto side = std::ranges::find_if(cone->surfaces, [](const Surface& surface) {
      const SurfaceShape& shape = *surface.shape;
      return shape.u_range().period > 0;
    });
    ASSERT_NE(side, cone->surfaces.end());
    const Eigen::Vector3d beyond(0, 0, 3), tip(0, 0, 2);
    EXPECT_NEAR(SurfaceSearch(*side->shape).closest(beyond).distance, 1, 1e-6) << top;
    const Range v = side->shape->v_range();
    EXPECT_NEAR(closest_from(*side->shape, beyond, 0.3, v.first + 0.5 * v.length()).distance, 1, 1e-6) << top;
    EXPECT_NEAR((side->shape->at(1, v.last + v.margin_after).x - tip).norm(), 0, 1e-6) << top;
    // At the other end it goes on.
    EXPECT_GT(v.margin_before, 0.5 * v.length()) << top;
  }
}

TEST_F(CadFile, HolesAreOutside) {
  const TopoDS_Shape plate = BRepPrimAPI_MakeBox(4, 4, 1).Shape();
  const gp_Ax2 axis(gp_Pnt(2, 2, -1), gp_Dir(0, 0, 1));
  const auto geometry = load(brep(BRepAlgoAPI_Cut(plate, BRepPrimAPI_MakeCylinder(axis, 1, 3).Shape()).Shape()));
  ASSERT_TRUE(geometry) << geometry.error().sentence;
  int with_hole = 0;
  for (const Surface& surface : geometry->surfaces) {
    const SurfaceFoot hole = SurfaceSearch(*surface.shape).closest({2, 2, 1});
    const SurfaceFoot rim = SurfaceSearch(*surface.shape).closest({2.9, 2, 1});
    const SurfaceFoot solid = SurfaceSearch(*surface.shape).closest({3.5, 3.5, 1});
    if (solid.distance > 1e-12) continue;
    ++with_hole;
    EXPECT_FALSE(surface.shape->contains(hole.u, hole.v));
    EXPECT_FALSE(surface.shape->contains(rim.u, rim.v));
    EXPECT_TRUE(surface.shape->contains(solid.u, solid.v));
  }
  EXPECT_EQ(with_hole, 1);
}

TEST_F(CadFile, StepComesInMillimetres) {
  std::stringstream content;
  content << std::ifstream(step(BRepPrimAPI_MakeBox(1, 2, 2).Shape())).rdbuf();
  const std::string millimetre = "LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.)";
  const std::string in_millimetres = content.str();
  const std::size_t at = in_millimetres.find(millimetre);
  ASSERT_NE(at, std::string::npos);
  // OpenCASCADE 7.6 writes a new unit beside numbers in the unit that was set before, so the unit is put in here.
  const std::pair<const char*, double> units[] = {{".MILLI.", 1}, {".CENTI.", 10}, {"$", 1000}};
  for (const auto& [prefix, factor] : units) {
    std::string with_unit = in_millimetres;
    with_unit.replace(at, millimetre.size(),
                      std::string("LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(") + prefix + ",.METRE.)");
    const auto geometry = load(text("unit.step", with_unit));
    ASSERT_TRUE(geometry) << geometry.error().sentence;
    EXPECT_NEAR(size(*geometry), 3 * factor, 1e-9 * factor) << prefix;
    EXPECT_EQ(geometry->surfaces.size(), 6U);
    EXPECT_EQ(geometry->curves.size(), 12U);
    EXPECT_EQ(geometry->vertices.size(), 8U);
  }
}

TEST_F(CadFile, FacesHaveTheNamesOfTheStepFile) {
  std::stringstream content;
  content << std::ifstream(step(BRepPrimAPI_MakeBox(1, 2, 3).Shape())).rdbuf();
  std::string named = content.str();
  const std::string plain = "ADVANCED_FACE(''";
  const char* names[] = {"Top", "NONE", " two words ", "\\X2\\00E9\\X0\\", "", "a\033[31m\tb"};
  std::size_t at = 0;
  for (const char* name : names) {
    at = named.find(plain, at + 1);
    ASSERT_NE(at, std::string::npos);
    named.replace(at, plain.size(), "ADVANCED_FACE('" + std::string(name) + "'");
  }
  const auto geometry = load(text("named.step", named));
  ASSERT_TRUE(geometry) << geometry.error().sentence;
  ASSERT_EQ(geometry->surfaces.size(), 6U);
  std::vector<std::string> found;
  for (const Surface& surface : geometry->surfaces) found.push_back(surface.name);
  EXPECT_EQ(found, (std::vector<std::string>{"Top", "", "two words", "é", "", "a[31mb"}));
  EXPECT_EQ(geometry->surfaces[0].text(), "surface 1 'Top'");
  EXPECT_EQ(geometry->surfaces[1].text(), "surface 2");
  EXPECT_EQ(load(step(BRepPrimAPI_MakeBox(1, 2, 3).Shape()))->surfaces[0].name, "");
}

TEST_F(CadFile, APartThatIsPlacedTwiceHasItsNamesInBothPlaces) {
  TopoDS_Compound both;
  BRep_Builder builder;
  builder.MakeCompound(both);
  const TopoDS_Shape box = BRepPrimAPI_MakeBox(1, 2, 3).Shape();
  gp_Trsf aside;
  aside.SetTranslation(gp_Vec(5, 0, 0));
  builder.Add(both, box);
  builder.Add(both, box.Moved(TopLoc_Location(aside)));
  std::stringstream content;
  content << std::ifstream(step(both)).rdbuf();
  std::string named = content.str();
  const std::string plain = "ADVANCED_FACE(''";
  named.replace(named.find(plain), plain.size(), "ADVANCED_FACE('Top'");
  const auto geometry = load(text("named.step", named));
  ASSERT_TRUE(geometry) << geometry.error().sentence;
  ASSERT_EQ(geometry->surfaces.size(), 12U);
  const auto is_top = [](const Surface& surface) { return surface.name == "Top"; };
  EXPECT_EQ(std::ranges::count_if(geometry->surfaces, is_top), 2);
}

TEST_F(CadFile, ADamagedFileGivesASentence) {
  const std::string whole = step(BRepPrimAPI_MakeBox(1, 2, 3).Shape());
  std::stringstream content;
  content << std::ifstream(whole).rdbuf();
  const std::pair<std::string, const char*> cases[] = {
      {text("cut.step", content.str().substr(0, content.str().size() / 2)), "the STEP file is cut off"},
      {text("zip.step", std::string("PK\3\4 something else")), "neither a STEP nor an IGES nor a BREP file"},
      {text("empty.step", ""), "neither a STEP nor an IGES nor a BREP file"},
      {text("none.step", "ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n"), "STEP file"},
      {text("cut.brep", "DBRep_DrawableShape\n\nCASCADE Topology V1, (c) Matra-Datavision\nLocations 5\n"),
       "BREP file"},
  };
  for (const auto& [path, sentence] : cases) {
    const auto geometry = load(path);
    ASSERT_FALSE(geometry) << path;
    EXPECT_EQ(geometry.error().kind, Error::Kind::BadInput);
    EXPECT_NE(geometry.error().sentence.find(sentence), std::string::npos) << geometry.error().sentence;
    EXPECT_NE(geometry.error().sentence.find(path), std::string::npos);
  }
}

TEST_F(CadFile, SaysWhatItTakesOfSeveralBodiesAndOpenShells) {
  TopoDS_Compound all;
  BRep_Builder builder;
  builder.MakeCompound(all);
  builder.Add(all, BRepPrimAPI_MakeBox(1, 1, 1).Shape());
  builder.Add(all, BRepPrimAPI_MakeSphere(gp_Pnt(5, 0, 0), 1).Shape());
  auto geometry = load(step(all));
  ASSERT_TRUE(geometry) << geometry.error().sentence;
  EXPECT_EQ(geometry->notes, std::vector<std::string>{"The geometry has 2 bodies; all are taken."});
  EXPECT_EQ(geometry->surfaces.size(), 7U);

  TopoDS_Shell shell;
  builder.MakeShell(shell);
  builder.Add(shell, TopExp_Explorer(BRepPrimAPI_MakeBox(1, 1, 1).Shape(), TopAbs_FACE).Current());
  geometry = load(brep(shell));
  ASSERT_TRUE(geometry) << geometry.error().sentence;
  EXPECT_EQ(geometry->notes,
            std::vector<std::string>{"The geometry has no body, only 1 face in 1 open shell; all are taken."});
  EXPECT_TRUE(load(step(BRepPrimAPI_MakeBox(1, 1, 1).Shape()))->notes.empty());
}

TEST_F(CadFile, SaysInWhichUnitAFileCame) {
  STEPControl_Controller::Init();  // defines the parameter
  ASSERT_TRUE(Interface_Static::SetCVal("write.step.unit", "INCH"));
  const std::string path = step(BRepPrimAPI_MakeBox(25.4, 25.4, 25.4).Shape());
  Interface_Static::SetCVal("write.step.unit", "MM");
  const auto geometry = load(path);
  ASSERT_TRUE(geometry) << geometry.error().sentence;
  ASSERT_EQ(geometry->notes.size(), 1U);
  EXPECT_EQ(geometry->notes[0], "The geometry's file has lengths in INCH; they are converted to millimetres.");
  // OpenCASCADE 7.6 writes 25.4 mm as 1 inch, 7.8 as 25.4 inches.
  std::ifstream file(path);
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  const double inches = text.find("(0.,0.,25.4)") == std::string::npos ? 1 : 25.4;
  EXPECT_NEAR(size(*geometry), inches * 25.4 * std::sqrt(3), 1e-9 * inches);
}

}  // namespace
}  // namespace varimesh::geometry
