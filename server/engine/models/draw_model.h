// A job that judges a CAD model, which has no elements: a picture of it is made, a mesh of flat triangles.
#pragma once

#include "core/base/error.h"
#include "core/geometry/cad/model_triangles.h"
#include "server/engine/engine.h"

namespace varimesh::server {

/// Whether the mesh of the request is a CAD file whose picture is wanted: the job judges it, and its only output is
/// MESH_FORMAT_PARTS.
bool wants_picture(const RunRequest& request);

/// Writes the triangles of a model as a mesh of order 1. Each face is an entity, and those that have a name are
/// physical groups too. The metrics have no quality, and their notes say what the model consists of. Errors: Output.
Expected<RunOutcome> draw_model(const geometry::ModelTriangles& model, const RunHooks& hooks);

}  // namespace varimesh::server
