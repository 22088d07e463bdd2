// What the plugin exports.
#include "core/geometry/plugin.h"

#include <Standard_Failure.hxx>
#include <exception>

#include "core/opencascade/shapes.h"

extern "C" __attribute__((visibility("default"))) bool varimesh_read_shape_5(std::string_view bytes,
                                                                             varimesh::geometry::Geometry& geometry,
                                                                             std::string& error) {
  try {
    TopoDS_Shape shape;
    return varimesh::cad::read_binary(bytes, shape, error) && varimesh::cad::build(shape, geometry, error);
  } catch (const Standard_Failure& failure) {
    error = std::string("OpenCASCADE gave up (") + failure.GetMessageString() + "); export it again, as STEP.";
  } catch (const std::exception& failure) {
    error = std::string("it is too large or damaged (") + failure.what() + ").";
  }
  return false;
}
