#include "client/command/inputs.h"

#include "client/command/command.h"
#include "client/input_file.h"
#include "core/formats/formats.h"
#include "core/mesh/displacements.h"

namespace varimesh::client {
namespace {

tl::unexpected<Failure> refused(const std::string& sentence) {
  return tl::unexpected(Failure{Failure::Kind::Refused, "BAD_INPUT", sentence, {}});
}
tl::unexpected<Failure> refused(const std::string& path, const Error& error) {
  return refused(path + ": " + error.sentence);
}

Outcome<void> put_boundary(HighOrderMesh& mesh, const Input& input) {
  if (!input.boundary.empty()) {
    const auto boundary = formats::read_file(input.boundary);
    if (!boundary) return refused(boundary.error().sentence);
    if (const auto done = replace_boundary(mesh, boundary->mesh); !done) return refused(input.boundary, done.error());
  }
  if (!input.displacements.empty()) {
    const auto text = read_whole(input.displacements, [] { return interrupts() > 0; });
    if (!text) return tl::unexpected(text.error());
    const auto displacements = read_displacements(*text, mesh.dimension);
    if (!displacements) return refused(input.displacements, displacements.error());
    if (const auto done = displace_boundary(mesh, *displacements); !done)
      return refused(input.displacements, done.error());
  }
  return {};
}

}  // namespace

void add_input(CLI::App& command, Input* input) {
  command.add_option("input", input->mesh, "The mesh")->required()->type_name("IN");
  command
      .add_option("--displacements", input->displacements,
                  "Move boundary nodes of a straight mesh first: a line 'number dx dy dz' a node")
      ->type_name("FILE");
  command
      .add_option("--boundary", input->boundary,
                  "Put boundary nodes where this mesh of the boundary alone has the nodes of the same numbers")
      ->type_name("MESH");
}

Outcome<v1::StoredMesh> upload(Client& client, const Input& input) {
  if (input.displacements.empty() && input.boundary.empty()) return client.upload_file(input.mesh);
  auto file = formats::read_file(input.mesh);
  if (!file) return refused(file.error().sentence);
  if (const auto put = put_boundary(file->mesh, input); !put) return tl::unexpected(put.error());
  auto curved = InputFile::temporary(input.mesh);
  if (!curved) return tl::unexpected(curved.error());
  const auto written =
      formats::write(file->mesh, file->format, [&](std::string_view bytes) { return curved->append(bytes); });
  if (!written) return tl::unexpected(Failure{Failure::Kind::File, "", written.error().sentence, {}});
  return client.upload(*curved);
}

}  // namespace varimesh::client
