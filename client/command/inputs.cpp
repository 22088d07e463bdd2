#include "client/command/inputs.h"

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

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

/// A folder of its own, gone with the object.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "varimesh-XXXXXX").string();
    if (mkdtemp(name.data()) != nullptr) path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

Outcome<void> put_boundary(HighOrderMesh& mesh, const Input& input) {
  if (!input.boundary.empty()) {
    const auto boundary = formats::read_file(input.boundary);
    if (!boundary) return refused(boundary.error().sentence);
    if (const auto done = replace_boundary(mesh, boundary->mesh); !done) return refused(input.boundary, done.error());
  }
  if (!input.displacements.empty()) {
    std::ifstream file(input.displacements, std::ios::binary);
    if (!file || std::filesystem::is_directory(input.displacements))
      return refused("The file " + input.displacements + " cannot be read; give a file of lines 'number dx dy dz'.");
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    const auto displacements = read_displacements(text);
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
  const TemporaryFolder folder;
  if (folder.path().empty())
    return tl::unexpected(Failure{Failure::Kind::File, "", "No temporary folder can be made; set TMPDIR.", {}});
  const std::string path = folder.path() / "curved.msh";
  if (const auto written = formats::write_file(file->mesh, file->format, path); !written)
    return tl::unexpected(Failure{Failure::Kind::File, "", written.error().sentence, {}});
  return client.upload_file(path);
}

}  // namespace varimesh::client
