// Pictures of bodies whose areas and volumes are known: triangles on all faces, turned outwards.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <BRepAlgoAPI_Cut.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <BRepPrimAPI_MakeTorus.hxx>
#include <BRepTools.hxx>
#include <BRep_Builder.hxx>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <TopExp_Explorer.hxx>
#include <TopoDS_Compound.hxx>
#include <TopoDS_Shape.hxx>
#include <TopoDS_Shell.hxx>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numbers>

#include "core/geometry/load.h"

namespace varimesh::geometry {
namespace {

constexpr double kPi = std::numbers::pi;

/// The picture of the model in a file.
Expected<ModelTriangles> picture_of(const std::filesystem::path& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  auto triangles = read_triangles(plugin_path(), file, "The model", std::int64_t{2} << 30);
  ::close(file);
  return triangles;
}

std::filesystem::path own_path(const std::string& ending) {
  return std::filesystem::path(testing::TempDir()) / ("varimesh_picture_" + std::to_string(::getpid()) + ending);
}

ModelTriangles picture_of(const TopoDS_Shape& shape) {
  const std::filesystem::path path = own_path(".brep");
  EXPECT_TRUE(BRepTools::Write(shape, path.c_str()));
  auto triangles = picture_of(path);
  std::filesystem::remove(path);
  EXPECT_TRUE(triangles) << triangles.error().sentence;
  return triangles ? std::move(*triangles) : ModelTriangles();
}

struct Measured {
  double area = 0,
         volume = 0;  ///< The volume by the divergence theorem: it is right only if all triangles turn outwards.
};

Measured measure(const ModelTriangles& model) {
  Measured sum;
  for (const FaceTriangles& face : model.faces) {
    const auto node = [&](std::size_t corner) {
      return Eigen::Map<const Eigen::Vector3d>(face.coordinates.data() + 3 * face.corners[corner]);
    };
    for (std::size_t at = 0; at < face.corners.size(); at += 3) {
      const Eigen::Vector3d a = node(at), b = node(at + 1), c = node(at + 2);
      const Eigen::Vector3d twice = (b - a).cross(c - a);
      sum.area += twice.norm() / 2;
      sum.volume += a.dot(twice) / 6;
    }
  }
  return sum;
}

TEST(ModelTriangles, OfABoxAreExact) {
  const ModelTriangles box = picture_of(BRepPrimAPI_MakeBox(gp_Pnt(5, 5, 5), 1, 2, 3).Shape());
  ASSERT_EQ(box.faces.size(), 6U);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(box.faces[i].tag, static_cast<int>(i) + 1);
    EXPECT_EQ(box.faces[i].corners.size(), 6U) << "two triangles";
  }
  EXPECT_NEAR(measure(box).area, 22, 1e-12);
  EXPECT_NEAR(measure(box).volume, 6, 1e-12);
  ASSERT_EQ(box.notes.size(), 1U);
  EXPECT_EQ(box.notes[0],
            "The model has 1 body, 6 faces and 12 edges. Its file does not say in which unit lengths are.");
}

TEST(ModelTriangles, FollowCurvedFaces) {
  const struct {
    TopoDS_Shape shape;
    double area, volume;
  } bodies[] = {
      {BRepPrimAPI_MakeCylinder(1, 2).Shape(), 6 * kPi, 2 * kPi},
      {BRepPrimAPI_MakeSphere(2).Shape(), 16 * kPi, 32 * kPi / 3},
      {BRepPrimAPI_MakeTorus(3, 1).Shape(), 12 * kPi * kPi, 6 * kPi * kPi},
      // The face of the hole is turned over.
      {BRepAlgoAPI_Cut(BRepPrimAPI_MakeBox(4, 4, 1).Shape(),
                       BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(2, 2, -1), gp_Dir(0, 0, 1)), 1, 3).Shape())
           .Shape(),
       48, 16 - kPi},
      {BRepPrimAPI_MakeSphere(2e-3).Shape(), 16e-6 * kPi, 32e-9 * kPi / 3},
  };
  for (const auto& [shape, area, volume] : bodies) {
    const Measured drawn = measure(picture_of(shape));
    EXPECT_NEAR(drawn.area / area, 1, 0.02) << area;
    EXPECT_NEAR(drawn.volume / volume, 1, 0.03) << volume;
  }
  EXPECT_EQ(picture_of(BRepPrimAPI_MakeSphere(1e-6).Shape()).faces.size(), 1U)
      << "next to the smallest that OpenCASCADE knows";
}

TEST(ModelTriangles, OfAPartThatIsPlacedTwiceAreInBothPlaces) {
  TopoDS_Compound both;
  BRep_Builder builder;
  builder.MakeCompound(both);
  const TopoDS_Shape box = BRepPrimAPI_MakeBox(1, 2, 3).Shape();
  gp_Trsf aside, mirrored;
  aside.SetTranslation(gp_Vec(5, 0, 0));
  mirrored.SetMirror(gp_Ax2(gp_Pnt(-1, 0, 0), gp_Dir(1, 0, 0)));
  builder.Add(both, box);
  builder.Add(both, box.Moved(TopLoc_Location(aside)));
  builder.Add(both, box.Moved(TopLoc_Location(mirrored), false));
  const ModelTriangles picture = picture_of(both);
  EXPECT_EQ(picture.faces.size(), 18U);
  ASSERT_EQ(picture.notes.size(), 1U);
  EXPECT_TRUE(picture.notes[0].starts_with("The model has 3 bodies, 18 faces and ")) << picture.notes[0];
  EXPECT_NEAR(measure(picture).volume, 18, 1e-12);
}

TEST(ModelTriangles, AreRefusedWithASentenceIfThereIsNothingToShow) {
  const std::filesystem::path path = own_path(".step");
  for (const std::string text :
       {"", "hello", "ISO-10303-21;\nHEADER;\n", "ISO-10303-21;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n"}) {
    std::ofstream(path, std::ios::trunc) << text;
    const auto picture = picture_of(path);
    ASSERT_FALSE(picture) << text;
    EXPECT_EQ(picture.error().kind, Error::Kind::BadInput);
    EXPECT_TRUE(picture.error().sentence.starts_with("The model cannot be used: ")) << picture.error().sentence;
  }
  std::filesystem::remove(path);
}

TEST(ModelTriangles, AreDecodedOnlyFromWholeAndSoundBytes) {
  const FaceTriangles one{7, {0, 0, 0, 1, 0, 0, 0, 1, 0}, {0, 1, 2}};
  FaceTriangles other = one;
  other.tag = 9;
  const std::vector<FaceTriangles> faces{one, other};
  const std::string bytes = encode(faces);
  const auto back = decode_faces(bytes);
  ASSERT_TRUE(back);
  ASSERT_EQ(back->size(), 2U);
  EXPECT_EQ((*back)[0].coordinates, faces[0].coordinates);
  EXPECT_EQ((*back)[0].corners, faces[0].corners);
  EXPECT_EQ((*back)[1].tag, 9);
  const std::string first = encode({faces[0]});
  for (std::size_t size = 1; size < first.size(); ++size) EXPECT_FALSE(decode_faces(first.substr(0, size))) << size;
  EXPECT_FALSE(decode_faces(encode({{1, {0, 0, 0}, {0, 0, 1}}}))) << "a node that is not there";
  EXPECT_FALSE(decode_faces(encode({{1, {0, 0, 0}, {0, 0, -1}}})));
  EXPECT_FALSE(decode_faces(encode({{1, {0, 0, std::numeric_limits<double>::quiet_NaN()}, {0, 0, 0}}})));
  EXPECT_FALSE(decode_faces(encode({one, {9, {}, {}}}))) << "a face without triangles";
  EXPECT_FALSE(decode_faces(encode({one, one}))) << "a tag twice";
  EXPECT_FALSE(decode_faces(encode({other, one})));
  EXPECT_FALSE(decode_faces(encode({{0, one.coordinates, one.corners}})));
  EXPECT_FALSE(decode_faces(encode({{-1, one.coordinates, one.corners}})));
  std::string huge = first;
  for (int i = 4; i < 12; ++i) huge[static_cast<std::size_t>(i)] = i % 4 == 3 ? '\x7f' : '\xff';
  EXPECT_FALSE(decode_faces(huge)) << "more nodes than there are bytes";
}

TEST(ModelTriangles, AreNoMoreThanAPictureShows) {
  // The second face has this many triangles and nodes, after one triangle with three nodes.
  const auto encoded = [](int triangles, int nodes) {
    std::vector<FaceTriangles> faces;
    for (int face = 1; face <= 2; ++face)
      faces.push_back({face, std::vector<double>(3 * static_cast<std::size_t>(face == 1 ? 3 : nodes)),
                       std::vector<std::int32_t>(3 * static_cast<std::size_t>(face == 1 ? 1 : triangles))});
    return encode(faces);
  };
  EXPECT_TRUE(decode_faces(encoded(kMostTriangles - 1, 3 * (kMostTriangles - 1))));
  EXPECT_FALSE(decode_faces(encoded(kMostTriangles, 3)));
  EXPECT_FALSE(decode_faces(encoded(1, 3 * kMostTriangles - 2)));
}

TEST(ModelTriangles, ComeWithNotesAboutFacesOutsideOfBodies) {
  TopoDS_Compound all;
  BRep_Builder builder;
  builder.MakeCompound(all);
  builder.Add(all, BRepPrimAPI_MakeBox(1, 1, 1).Shape());
  builder.Add(all, TopExp_Explorer(BRepPrimAPI_MakeBox(gp_Pnt(5, 0, 0), 1, 1, 1).Shape(), TopAbs_FACE).Current());
  ModelTriangles picture = picture_of(all);
  ASSERT_EQ(picture.notes.size(), 2U);
  EXPECT_TRUE(picture.notes[0].starts_with("The model has 1 body, 7 faces and ")) << picture.notes[0];
  EXPECT_EQ(picture.notes[1], "1 face of the geometry outside of its bodies: taken too.");
  TopoDS_Shell shell;
  builder.MakeShell(shell);
  builder.Add(shell, TopExp_Explorer(BRepPrimAPI_MakeBox(1, 1, 1).Shape(), TopAbs_FACE).Current());
  picture = picture_of(shell);
  ASSERT_EQ(picture.notes.size(), 2U);
  EXPECT_EQ(picture.notes[1], "The geometry has no body, only 1 face in 1 open shell; all are taken.");
}

}  // namespace
}  // namespace varimesh::geometry
