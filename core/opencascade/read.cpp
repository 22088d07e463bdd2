// Reads CAD files: bytes to a shape, and a shape to entities.
#include <BRepTools.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <BinTools.hxx>
#include <IGESControl_Reader.hxx>
#include <Interface_Static.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <Message_PrinterOStream.hxx>
#include <STEPControl_Reader.hxx>
#include <Standard_Failure.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS.hxx>
#include <algorithm>
#include <exception>
#include <fstream>
#include <map>
#include <string>

#include "core/geometry/plugin.h"
#include "core/opencascade/shapes.h"

namespace varimesh::cad {
namespace {

enum class Kind { Unknown, Step, Iges, Brep, Binary };

/// By content, since endings lie. A STEP file begins with ISO-10303-21, a BREP file and OpenCASCADE's binary format
/// name themselves in their first lines, and an IGES file has the letter S in column 73 of its first line.
Kind kind_of(const std::string& head) {
  if (head.find("ISO-10303-21") != std::string::npos) return Kind::Step;
  if (head.find("Open CASCADE Topology") < 16) return Kind::Binary;
  if (head.find("DBRep_DrawableShape") != std::string::npos || head.find("CASCADE Topology") != std::string::npos)
    return Kind::Brep;
  const std::string first = head.substr(0, head.find_first_of("\r\n"));
  return first.size() >= 73 && first[72] == 'S' ? Kind::Iges : Kind::Unknown;
}

template <class Reader>
bool transfer(const std::string& path, const char* what, TopoDS_Shape& shape, std::string& error) {
  Reader reader;
  Interface_Static::SetCVal("xstep.cascade.unit", "MM");  // the unit of what is read
  if (reader.ReadFile(path.c_str()) != IFSelect_RetDone) {
    error = std::string("it begins like a ") + what + " file, but it is damaged or cut off; export it again.";
    return false;
  }
  reader.TransferRoots();
  shape = reader.OneShape();
  if (!shape.IsNull()) return true;
  error = std::string("the ") + what + " file has no body that can be read; export the model as solids or surfaces.";
  return false;
}

}  // namespace

bool read_shape(const std::string& path, TopoDS_Shape& shape, std::string& error) {
  Message::DefaultMessenger()->RemovePrinters(STANDARD_TYPE(Message_PrinterOStream));
  std::ifstream file(path, std::ios::binary);
  std::string head(1024, '\0');
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(file.gcount()));
  switch (kind_of(head)) {
    case Kind::Step: {
      // A file that was cut off lacks its last line. The reader would take what there is.
      file.clear();
      file.seekg(0, std::ios::end);
      const std::streamoff size = file.tellg();
      std::string tail(static_cast<std::size_t>(std::min<std::streamoff>(size, 256)), '\0');
      file.seekg(size - static_cast<std::streamoff>(tail.size()));
      file.read(tail.data(), static_cast<std::streamsize>(tail.size()));
      if (tail.find("END-ISO-10303-21") == std::string::npos) {
        error = "the STEP file is cut off: its last line, END-ISO-10303-21, is missing; export or copy it again.";
        return false;
      }
      return transfer<STEPControl_Reader>(path, "STEP", shape, error);
    }
    case Kind::Iges:
      return transfer<IGESControl_Reader>(path, "IGES", shape, error);
    case Kind::Brep: {
      BRep_Builder builder;
      if (BRepTools::Read(shape, path.c_str(), builder) && !shape.IsNull()) return true;
      error = "it begins like a BREP file, but it is damaged or cut off; export it again.";
      return false;
    }
    case Kind::Binary:
      file.clear();
      file.seekg(0);
      BinTools::Read(shape, file);
      if (!shape.IsNull()) return true;
      error = "it begins like a binary BREP file, but it is damaged or cut off; export it again.";
      return false;
    case Kind::Unknown:
      break;
  }
  error = "it is neither a STEP nor an IGES nor a BREP file; export the model as STEP.";
  return false;
}

namespace {

class Builder {
 public:
  explicit Builder(const TopoDS_Shape& shape) {
    TopExp::MapShapes(shape, TopAbs_VERTEX, vertices_);
    TopExp::MapShapes(shape, TopAbs_EDGE, edges_);
    TopExp::MapShapes(shape, TopAbs_FACE, faces_);
  }

  void build(geometry::Geometry& result) {
    for (int i = 1; i <= vertices_.Extent(); ++i) {
      const gp_Pnt x = BRep_Tool::Pnt(TopoDS::Vertex(vertices_(i)));
      result.vertices.push_back({i, {x.X(), x.Y(), x.Z()}});
    }
    add_curves(result);
    for (int i = 1; i <= faces_.Extent(); ++i) add_surface(i, result);
  }

 private:
  void add_curves(geometry::Geometry& result) {
    for (int i = 1; i <= edges_.Extent(); ++i) {
      geometry::Curve curve;
      curve.tag = i;
      curve.shape = curve_shape(TopoDS::Edge(edges_(i)));
      if (curve.shape == nullptr) continue;
      for (TopExp_Explorer at(edges_(i), TopAbs_VERTEX); at.More(); at.Next()) {
        const int vertex = vertices_.FindIndex(at.Current()) - 1;
        if (std::ranges::find(curve.vertices, vertex) == curve.vertices.end()) curve.vertices.push_back(vertex);
      }
      place_[i] = static_cast<int>(result.curves.size());
      result.curves.push_back(std::move(curve));
    }
  }

  void add_surface(int number, geometry::Geometry& result) {
    geometry::Surface surface;
    surface.tag = number;
    surface.shape = surface_shape(TopoDS::Face(faces_(number)));
    if (surface.shape == nullptr) {
      result.notes.push_back("Face " + std::to_string(number) + " of the geometry has no surface with parameters.");
      return;
    }
    const int index = static_cast<int>(result.surfaces.size());
    for (TopExp_Explorer at(faces_(number), TopAbs_EDGE); at.More(); at.Next()) {
      const auto place = place_.find(edges_.FindIndex(at.Current()));
      if (place == place_.end()) continue;
      result.curves[static_cast<std::size_t>(place->second)].surfaces.push_back(index);
      if (std::ranges::find(surface.curves, place->second) == surface.curves.end())
        surface.curves.push_back(place->second);
    }
    result.surfaces.push_back(std::move(surface));
  }

  TopTools_IndexedMapOfShape vertices_, edges_, faces_;
  std::map<int, int> place_;  ///< Of an edge's number: its index in Geometry::curves.
};

}  // namespace

bool build(const TopoDS_Shape& shape, geometry::Geometry& result, std::string& error) {
  Builder(shape).build(result);
  if (!result.surfaces.empty()) return true;
  error = "it has no face with a surface; export the model as solids or surfaces.";
  return false;
}

}  // namespace varimesh::cad
