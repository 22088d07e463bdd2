// Reads CAD files: bytes to a shape, and a shape to entities.
#include <BRepTools.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <BinTools.hxx>
#include <IGESControl_Reader.hxx>
#include <IGESData_GlobalSection.hxx>
#include <IGESData_IGESModel.hxx>
#include <Interface_Static.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <Message_PrinterOStream.hxx>
#include <STEPControl_Reader.hxx>
#include <Standard_Failure.hxx>
#include <TColStd_SequenceOfAsciiString.hxx>
#include <TCollection_HAsciiString.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS.hxx>
#include <algorithm>
#include <exception>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "core/geometry/cad/file_kind.h"
#include "core/geometry/plugin.h"
#include "core/opencascade/shapes.h"

namespace varimesh::cad {
namespace {

using Kind = geometry::CadFileKind;

/// What a file says about its unit of length. Everything is read in millimetres.
std::string units_note(STEPControl_Reader& reader) {
  TColStd_SequenceOfAsciiString lengths, angles, solid_angles;
  reader.FileUnits(lengths, angles, solid_angles);
  std::set<std::string> names;
  for (const TCollection_AsciiString& name : lengths) names.insert(name.ToCString());
  if (names.empty() || names == std::set<std::string>{"millimetre"}) return "";
  std::string all;
  for (const std::string& name : names) all += (all.empty() ? "" : ", ") + name;
  return "The geometry's file has lengths in " + all + "; they are converted to millimetres.\n";
}
std::string units_note(IGESControl_Reader& reader) {
  const Handle(IGESData_IGESModel) model = reader.IGESModel();
  if (model.IsNull() || model->GlobalSection().UnitFlag() == 2) return "";  // 2: millimetres
  const Handle(TCollection_HAsciiString) name = model->GlobalSection().UnitName();
  return "The geometry's file has lengths in " + (name.IsNull() ? "its own unit" : std::string(name->ToCString())) +
         "; they are converted to millimetres.\n";
}

std::string faces_text(int count) { return std::to_string(count) + (count == 1 ? " face" : " faces"); }

/// Which bodies and shells were taken, if there is more than one body.
void note_bodies(const TopoDS_Shape& shape, FileFacts& facts) {
  TopTools_IndexedMapOfShape solids, faces;
  TopExp::MapShapes(shape, TopAbs_SOLID, solids);
  TopExp::MapShapes(shape, TopAbs_FACE, faces);
  TopTools_IndexedMapOfShape of_solids;
  for (int i = 1; i <= solids.Extent(); ++i) TopExp::MapShapes(solids(i), TopAbs_FACE, of_solids);
  const int loose = faces.Extent() - of_solids.Extent();
  if (solids.Extent() > 1)
    facts.bodies = "The geometry has " + std::to_string(solids.Extent()) + " bodies; all are taken.\n";
  if (loose > 0 && solids.Extent() > 0)
    facts.loose = faces_text(loose) + " of the geometry outside of its bodies: taken too.\n";
  if (solids.Extent() == 0 && loose > 0) {
    int open = 0;
    for (TopExp_Explorer at(shape, TopAbs_SHELL); at.More(); at.Next())
      open += BRep_Tool::IsClosed(at.Current()) ? 0 : 1;
    facts.loose = "The geometry has no body, only " + faces_text(loose) +
                  (open > 0 ? " in " + std::to_string(open) + " open shell" + (open > 1 ? "s" : "") : "") +
                  "; all are taken.\n";
  }
}

template <class Reader>
bool transfer(const std::string& path, const char* what, TopoDS_Shape& shape, FileFacts& facts, std::string& error) {
  Reader reader;
  Interface_Static::SetCVal("xstep.cascade.unit", "MM");  // the unit of what is read
  if (reader.ReadFile(path.c_str()) != IFSelect_RetDone) {
    error = std::string("it begins like a ") + what + " file, but it is damaged or cut off; export it again.";
    return false;
  }
  facts.notes += units_note(reader);
  facts.has_unit = true;
  reader.TransferRoots();
  shape = reader.OneShape();
  if (!shape.IsNull()) {
    facts.names = face_names(reader.WS(), shape);
    return true;
  }
  error = std::string("the ") + what + " file has no body that can be read; export the model as solids or surfaces.";
  return false;
}

bool read_any(const std::string& path, TopoDS_Shape& shape, FileFacts& facts, std::string& error) {
  Message::DefaultMessenger()->RemovePrinters(STANDARD_TYPE(Message_PrinterOStream));
  std::ifstream file(path, std::ios::binary);
  std::string head(geometry::kBytesOfKind, '\0');
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(file.gcount()));
  switch (geometry::kind_of_cad_file(head)) {
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
      return transfer<STEPControl_Reader>(path, "STEP", shape, facts, error);
    }
    case Kind::Iges:
      return transfer<IGESControl_Reader>(path, "IGES", shape, facts, error);
    case Kind::Brep: {
      BRep_Builder builder;
      if (BRepTools::Read(shape, path.c_str(), builder) && !shape.IsNull()) return true;
      error = "it begins like a BREP file, but it is damaged or cut off; export it again.";
      return false;
    }
    case Kind::Binary: {
      file.clear();
      file.seekg(0);
      std::ostringstream bytes;
      bytes << file.rdbuf();
      return read_binary(bytes.view(), shape, error);
    }
    case Kind::Unknown:
      break;
  }
  error = "it is neither a STEP nor an IGES nor a BREP file; export the model as STEP.";
  return false;
}

}  // namespace

bool read_binary(std::string_view bytes, TopoDS_Shape& shape, std::string& error) {
  Message::DefaultMessenger()->RemovePrinters(STANDARD_TYPE(Message_PrinterOStream));
  std::istringstream stream{std::string(bytes)};
  BinTools::Read(shape, stream);
  if (!shape.IsNull()) return true;
  error = "it begins like a binary BREP file, but it is damaged or cut off; export it again.";
  return false;
}

bool read_shape(const std::string& path, TopoDS_Shape& shape, FileFacts& facts, std::string& error) {
  if (!read_any(path, shape, facts, error)) return false;
  note_bodies(shape, facts);
  return true;
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
    note_left_out(result);
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
    surface.shape = surface_shape(TopoDS::Face(faces_(number)), patches_);
    if (surface.shape == nullptr) {
      left_out_.push_back(number);
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

  /// One sentence about all faces without a surface.
  void note_left_out(geometry::Geometry& result) const {
    constexpr std::size_t kShown = 10;
    if (left_out_.empty()) return;
    std::string text = left_out_.size() == 1 ? "Face " : "Faces ";
    for (std::size_t i = 0; i < std::min(left_out_.size(), kShown); ++i)
      text += (i > 0 ? ", " : "") + std::to_string(left_out_[i]);
    if (left_out_.size() > kShown) text += " and " + std::to_string(left_out_.size() - kShown) + " more";
    result.notes.push_back(text + " of the geometry " + (left_out_.size() == 1 ? "has" : "have") +
                           " no surface with parameters.");
  }

  TopTools_IndexedMapOfShape vertices_, edges_, faces_;
  std::vector<int> left_out_;  ///< The numbers of faces without a surface.
  SharedPatches patches_;
  std::map<int, int> place_;  ///< Of an edge's number: its index in Geometry::curves.
};

}  // namespace

bool build(const TopoDS_Shape& shape, geometry::Geometry& result, std::string& error) {
  Builder(shape).build(result);
  if (!result.surfaces.empty() || !result.curves.empty()) return true;  // edges are a profile for meshes in a plane
  error = "it has no face with a surface and no edge with a curve; export the model as solids, surfaces or curves.";
  return false;
}

}  // namespace varimesh::cad
