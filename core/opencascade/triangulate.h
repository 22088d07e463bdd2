// A picture of a CAD model: its faces as triangles. Internal to the program that reads files.
#pragma once

#include <TopoDS_Shape.hxx>
#include <string>
#include <vector>

#include "core/geometry/cad/model_triangles.h"

namespace varimesh::cad {

/// Covers all faces of the shape with triangles, numbered as build() numbers them. The triangles are at most a
/// thousandth of the model's size away from its faces, and turn by at most 17° from one to the next. If a model would
/// get too many triangles, both bounds are larger. Faces that cannot be covered are left out, with a line in `notes`.
/// Returns false, with a sentence in `error`, if no face can be covered. May throw Standard_Failure, and may crash on a
/// damaged shape.
bool triangulate(const TopoDS_Shape& shape, std::vector<geometry::FaceTriangles>& faces, std::string& notes,
                 std::string& error);

/// What the shape consists of and in which unit it is, as a line.
std::string parts_note(const TopoDS_Shape& shape, bool has_unit);

}  // namespace varimesh::cad
