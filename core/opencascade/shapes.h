// OpenCASCADE's edges and faces as the shapes of core/geometry. Internal to the plugin.
#pragma once

#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Shape.hxx>
#include <gp_XYZ.hxx>
#include <memory>
#include <string>
#include <string_view>

#include "core/geometry/geometry.h"
#include "core/opencascade/names.h"
#include "core/opencascade/spline_patches.h"

namespace varimesh::cad {

inline Eigen::Vector3d vector(const gp_XYZ& a) { return {a.X(), a.Y(), a.Z()}; }

/// Null if the edge has no curve in space (it is degenerate, or the file has only a curve in parameters).
std::shared_ptr<const geometry::CurveShape> curve_shape(const TopoDS_Edge& edge);

/// Null if the face has no surface with parameters, or if its range of parameters is empty or infinite.
/// @param shared  those of all faces of the file
std::shared_ptr<const geometry::SurfaceShape> surface_shape(const TopoDS_Face& face, SharedPatches& shared);

/// What a file has besides its shape.
struct FileFacts {
  /// Lines that say what was taken, if a reader might expect something else.
  std::string notes;
  std::string bodies;  ///< The same about several bodies.
  std::string loose;   ///< The same about faces outside of bodies, and open shells.
  FaceNames names;
  bool has_unit = false;  ///< Of length. What has one is read in millimetres.
};

/// Reads a STEP, IGES or BREP file, or one in OpenCASCADE's binary format. Returns false, with a sentence in `error`,
/// if it cannot be used. May throw Standard_Failure or a standard exception, and may crash on a damaged file.
bool read_shape(const std::string& path, TopoDS_Shape& shape, FileFacts& facts, std::string& error);

/// Reads a shape in OpenCASCADE's binary format, in the same way.
bool read_binary(std::string_view bytes, TopoDS_Shape& shape, std::string& error);

/// Fills `result` with all entities of the shape, numbered as OpenCASCADE explores it, from 1 per dimension. Gmsh does
/// the same. Returns false, with a sentence in `error`, if there is no surface.
bool build(const TopoDS_Shape& shape, geometry::Geometry& result, std::string& error);

}  // namespace varimesh::cad
