#include "core/opencascade/triangulate.h"

#include <BRepBndLib.hxx>
#include <BRepMesh_IncrementalMesh.hxx>
#include <BRepTools.hxx>
#include <BRep_Tool.hxx>
#include <Bnd_Box.hxx>
#include <Poly_Triangulation.hxx>
#include <Precision.hxx>
#include <TopExp.hxx>
#include <TopLoc_Location.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Face.hxx>
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/counted.h"

namespace varimesh::cad {
namespace {

using geometry::FaceTriangles;
using geometry::kMostTriangles;

/// How far triangles may be from the faces, as a part of the model's size, and by which angle in radians they may turn.
struct Fineness {
  double distance, angle;
};
constexpr Fineness kFinenesses[] = {{1e-3, 0.3}, {4e-3, 0.6}, {2e-2, 1.2}};

/// The triangles of a face that has them; empty: it has none.
FaceTriangles triangles_of(const TopoDS_Face& face) {
  FaceTriangles result;
  TopLoc_Location at;
  const Handle(Poly_Triangulation) all = BRep_Tool::Triangulation(face, at);
  if (all.IsNull()) return result;
  const gp_Trsf moved = at.Transformation();
  for (int i = 1; i <= all->NbNodes(); ++i) {
    const gp_Pnt x = all->Node(i).Transformed(moved);
    result.coordinates.insert(result.coordinates.end(), {x.X(), x.Y(), x.Z()});
  }
  const bool is_turned = (face.Orientation() == TopAbs_REVERSED) != moved.IsNegative();
  for (int i = 1; i <= all->NbTriangles(); ++i) {
    int a = 0, b = 0, c = 0;
    all->Triangle(i).Get(a, b, c);
    if (is_turned) std::swap(b, c);
    result.corners.insert(result.corners.end(), {a - 1, b - 1, c - 1});
  }
  return result;
}

/// The diagonal of a box around the shape; 0 if there is none.
double size_of(const TopoDS_Shape& shape) {
  Bnd_Box box;
  BRepBndLib::Add(shape, box, false);
  return box.IsVoid() || box.IsOpen() ? 0 : std::sqrt(box.SquareExtent());
}

}  // namespace

bool triangulate(const TopoDS_Shape& shape, std::vector<FaceTriangles>& faces, std::string& notes, std::string& error) {
  const double size = size_of(shape);
  TopTools_IndexedMapOfShape map;
  TopExp::MapShapes(shape, TopAbs_FACE, map);
  if (map.IsEmpty() || !(size > 0)) {
    error = "it has no face that can be shown; export the model as solids or surfaces.";
    return false;
  }
  int triangles = 0;
  for (const auto& [distance, angle] : kFinenesses) {
    BRepTools::Clean(shape);
    // OpenCASCADE takes no smaller distance than that at which two points are the same to it.
    BRepMesh_IncrementalMesh(shape, std::max(distance * size, Precision::Confusion()), false, angle, false);
    triangles = 0;
    for (int i = 1; i <= map.Extent(); ++i) {
      TopLoc_Location at;
      const auto found = BRep_Tool::Triangulation(TopoDS::Face(map(i)), at);
      triangles += found.IsNull() ? 0 : found->NbTriangles();
    }
    if (triangles <= kMostTriangles) break;
  }
  if (triangles == 0 || triangles > kMostTriangles) {
    error = triangles == 0 ? "none of its faces can be covered with triangles; export it again, as STEP."
                           : "it has too many small faces for a picture; simplify the model.";
    return false;
  }
  int left_out = 0;
  for (int i = 1; i <= map.Extent(); ++i) {
    FaceTriangles face = triangles_of(TopoDS::Face(map(i)));
    face.tag = i;
    if (face.corners.empty())
      ++left_out;
    else
      faces.push_back(std::move(face));
  }
  if (left_out > 0)
    notes += counted(left_out, "face is", "faces are") + " not in the picture: no triangles cover " +
             (left_out == 1 ? "it" : "them") + ".\n";
  return true;
}

std::string parts_note(const TopoDS_Shape& shape, bool has_unit) {
  const auto number = [&](TopAbs_ShapeEnum kind) {
    TopTools_IndexedMapOfShape map;
    TopExp::MapShapes(shape, kind, map);
    return map.Extent();
  };
  return "The model has " + counted(number(TopAbs_SOLID), "body", "bodies") + ", " +
         counted(number(TopAbs_FACE), "face", "faces") + " and " + counted(number(TopAbs_EDGE), "edge", "edges") +
         (has_unit ? ". Lengths are in millimetres.\n" : ". Its file does not say in which unit lengths are.\n");
}

}  // namespace varimesh::cad
