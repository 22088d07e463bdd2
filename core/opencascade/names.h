// The names that a STEP or IGES file gives to its faces. Internal to the program that reads files.
#pragma once

#include <Standard_Handle.hxx>
#include <TopoDS_Shape.hxx>
#include <map>
#include <string>

class XSControl_WorkSession;

namespace varimesh::cad {

/// By the number of a face, as build() counts: its name, in the bytes of the file without control characters.
using FaceNames = std::map<int, std::string>;

/// The names of the faces of `shape`, which the session has read. Names that say nothing ('' and 'NONE') are left out.
FaceNames face_names(const Handle(XSControl_WorkSession) & session, const TopoDS_Shape& shape);

}  // namespace varimesh::cad
