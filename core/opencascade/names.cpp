#include "core/opencascade/names.h"

#include <IGESData_IGESEntity.hxx>
#include <Interface_InterfaceModel.hxx>
#include <StepRepr_RepresentationItem.hxx>
#include <StepShape_FaceSurface.hxx>
#include <TCollection_HAsciiString.hxx>
#include <TopExp.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TransferBRep.hxx>
#include <Transfer_TransientProcess.hxx>
#include <XSControl_TransferReader.hxx>
#include <XSControl_WorkSession.hxx>
#include <unordered_map>

namespace varimesh::cad {
namespace {

constexpr std::size_t kMostBytes = 200;  ///< Of a name.

/// The name that an entity of the file has. In STEP only that of a face counts.
std::string name_of(const Handle(Standard_Transient) & entity) {
  Handle(TCollection_HAsciiString) name;
  if (const auto face = Handle(StepShape_FaceSurface)::DownCast(entity); !face.IsNull())
    name = face->Name();
  else if (const auto iges = Handle(IGESData_IGESEntity)::DownCast(entity); !iges.IsNull() && iges->HasName())
    name = iges->NameValue();
  if (name.IsNull()) return "";
  std::string text;
  for (const char c : std::string(name->ToCString()).substr(0, kMostBytes))
    if (static_cast<unsigned char>(c) >= ' ') text += c;
  const auto first = text.find_first_not_of(' ');
  if (first == std::string::npos) return "";
  text = text.substr(first, text.find_last_not_of(' ') - first + 1);
  return text == "NONE" ? "" : text;
}

}  // namespace

FaceNames face_names(const Handle(XSControl_WorkSession) & session, const TopoDS_Shape& shape) {
  const Handle(Interface_InterfaceModel) model = session->Model();
  const Handle(Transfer_TransientProcess) process = session->TransferReader()->TransientProcess();
  FaceNames names;
  if (model.IsNull() || process.IsNull()) return names;
  // A face of a part that is placed several times has the same name in each place.
  std::unordered_map<const Standard_Transient*, std::string> of_shape;
  for (int i = 1; i <= model->NbEntities(); ++i) {
    const std::string name = name_of(model->Value(i));
    if (name.empty()) continue;
    const TopoDS_Shape result = TransferBRep::ShapeResult(process, model->Value(i));
    if (result.IsNull()) continue;
    TopTools_IndexedMapOfShape parts;  // a face that was divided has several
    TopExp::MapShapes(result, TopAbs_FACE, parts);
    for (int part = 1; part <= parts.Extent(); ++part) of_shape.emplace(parts(part).TShape().get(), name);
  }
  TopTools_IndexedMapOfShape faces;
  TopExp::MapShapes(shape, TopAbs_FACE, faces);
  for (int number = 1; number <= faces.Extent(); ++number)
    if (const auto found = of_shape.find(faces(number).TShape().get()); found != of_shape.end())
      names.emplace(number, found->second);
  return names;
}

}  // namespace varimesh::cad
