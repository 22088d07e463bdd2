// OpenCASCADE's edges and faces as the shapes of core/geometry. Internal to the plugin.
#pragma once

#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <gp_XYZ.hxx>
#include <memory>

#include "core/geometry/geometry.h"

namespace varimesh::cad {

inline Eigen::Vector3d vector(const gp_XYZ& a) { return {a.X(), a.Y(), a.Z()}; }

/// Null if the edge has no curve in space (it is degenerate, or the file has only a curve in parameters).
std::shared_ptr<const geometry::CurveShape> curve_shape(const TopoDS_Edge& edge);

/// Null if the face has no surface with parameters, or if its range of parameters is empty or infinite.
std::shared_ptr<const geometry::SurfaceShape> surface_shape(const TopoDS_Face& face);

}  // namespace varimesh::cad
