#include "server/engine/models/draw_model.h"

#include <cassert>
#include <numeric>
#include <string_view>

#include "core/geometry/cad/file_kind.h"
#include "core/mesh/high_order_mesh.h"
#include "server/engine/mesh_parts.h"

namespace varimesh::server {
namespace {

/// @param model  as read_triangles() hands it out, so that numbers of nodes are small
HighOrderMesh mesh_of(const geometry::ModelTriangles& model) {
  HighOrderMesh mesh;
  mesh.dimension = 3;
  mesh.order = 1;
  std::int64_t elements = 0;
  for (const geometry::FaceTriangles& face : model.faces) {
    assert(mesh.node_count() <= 3 * std::size_t{geometry::kMostTriangles});
    const auto first = static_cast<std::int32_t>(mesh.node_count());
    mesh.coordinates.insert(mesh.coordinates.end(), face.coordinates.begin(), face.coordinates.end());
    ElementBlock& block = mesh.blocks.emplace_back();
    block.shape = Shape::Triangle;
    block.entity = face.tag;
    for (const std::int32_t corner : face.corners) block.nodes.push_back(first + corner);
    block.numbers.resize(face.corners.size() / 3);
    std::iota(block.numbers.begin(), block.numbers.end(), elements + 1);
    elements += static_cast<std::int64_t>(block.numbers.size());
    if (face.name.empty()) continue;
    block.physical = {face.tag};
    mesh.physical_groups.push_back({2, face.tag, face.name});
  }
  return mesh;
}

/// The bytes of the mesh in memory, with what a vector may have in reserve.
std::int64_t memory_of(const geometry::ModelTriangles& model) {
  std::size_t bytes = 0;
  for (const geometry::FaceTriangles& face : model.faces)
    bytes += face.coordinates.size() * sizeof(double) + face.corners.size() * 2 * sizeof(std::int32_t) + 1024;
  return static_cast<std::int64_t>(2 * bytes);
}

}  // namespace

bool wants_picture(const RunRequest& request) {
  return request.quality && request.format == v1::MESH_FORMAT_UNSPECIFIED && request.outputs.size() == 1 &&
         request.outputs.front() == v1::MESH_FORMAT_PARTS &&
         geometry::kind_of_cad_file(request.input->bytes()) != geometry::CadFileKind::Unknown;
}

Expected<RunOutcome> draw_model(const geometry::ModelTriangles& model, const RunHooks& hooks) {
  RunOutcome outcome;
  const Expected<bool> admitted = hooks.admit ? hooks.admit(memory_of(model)) : Expected<bool>(true);
  if (!admitted) return tl::unexpected(admitted.error());
  outcome.stopped = outcome.unwritten = !*admitted;
  if (!*admitted) return outcome;
  const HighOrderMesh mesh = mesh_of(model);
  if (const auto written = write_mesh_parts(mesh, hooks.open_output(v1::MESH_FORMAT_PARTS)); !written)
    return tl::unexpected(written.error());
  v1::MeshSummary& size = *outcome.metrics.mutable_mesh();
  size.set_dimension(mesh.dimension);
  size.set_order(mesh.order);
  size.set_nodes(static_cast<std::int64_t>(mesh.node_count()));
  for (const std::string& note : model.notes) outcome.metrics.add_notes(note);
  return outcome;
}

}  // namespace varimesh::server
