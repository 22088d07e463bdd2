#include "tests/bench/table/meshes.h"

#include <array>
#include <cstdio>
#include <cstdlib>
#include <optional>

#include "core/formats/formats.h"
#include "tests/bench/structured/structured_mesh.h"

namespace varimesh::bench {
namespace {

namespace fs = std::filesystem;

/// If a file is not MSH 2.2 in ASCII, generate.py puts the version into its name, and "b" for binary.
std::optional<std::string> in_folder(const fs::path& folder, const std::string& name) {
  std::error_code ignored;
  for (const char* version : {"", ".41b", ".22b"})
    if (fs::path path = folder / (name + version + ".msh"); fs::exists(path, ignored)) return path.string();
  return std::nullopt;
}

std::string quoted(const fs::path& path) {
  std::string out = "'";
  for (const char c : path.string()) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

std::optional<Expected<HighOrderMesh>> structured(const std::string& name) {
  std::array<char, 20> shape{};
  StructuredMesh wanted;
  long long elements = 0;
  int cells = 0;
  if (std::sscanf(name.c_str(), "squares_%d", &cells) == 1) return perturbed_square(cells);
  if (std::sscanf(name.c_str(), "%19[a-z]_p%d_%lld", shape.data(), &wanted.order, &elements) != 3) return std::nullopt;
  wanted.shape = shape.data() == reference::info(Shape::Hexahedron).plural ? Shape::Hexahedron : Shape::Tetrahedron;
  wanted.elements = elements;
  return cube_with_hole(wanted);
}

Expected<std::string> write_structured(const HighOrderMesh& mesh, const fs::path& folder, const std::string& name) {
  std::error_code failure;
  fs::create_directories(folder, failure);
  if (failure) return bad_input(name + ": cannot make the folder " + folder.string() + ": " + failure.message());
  const std::string path = (folder / (name + ".41b.msh")).string();
  const Expected<void> written = formats::write_file(mesh, formats::Format::Msh41Binary, path);
  if (!written) return bad_input(name + ": " + written.error().sentence);
  return path;
}

}  // namespace

std::string cube_name(Shape shape, int order, std::int64_t elements) {
  return std::string(reference::info(shape).plural) + "_p" + std::to_string(order) + "_" + std::to_string(elements);
}

std::string square_name(int cells) { return "squares_" + std::to_string(cells); }

Expected<std::string> Meshes::find(const std::string& name) const {
  for (const fs::path& folder : {cases_ / "meshes", cache_})
    if (const auto path = in_folder(folder, name)) return *path;
  if (const auto made = structured(name)) {
    if (!*made) return bad_input(name + ": " + made->error().sentence);
    return write_structured(**made, cache_, name);
  }
  const fs::path script = cases_ / "generate.py";
  std::error_code failure;
  if (!fs::exists(script, failure))
    return bad_input(name + ": there is no " + script.string() + "; set VARIMESH_CASES to the folder that contains it");
  // The mesh is made in a folder of its own, so that an interrupted run leaves no incomplete mesh under the name.
  const fs::path part = cache_ / (name + ".part"), log = cache_ / (name + ".log");
  fs::create_directories(part, failure);
  if (failure) return bad_input(name + ": cannot make the folder " + part.string() + ": " + failure.message());
  std::fprintf(stderr, "making %s\n", name.c_str());
  const std::string command =
      "OUT=" + quoted(part) + " /usr/bin/python3 " + quoted(script) + " " + name + " >" + quoted(log) + " 2>&1";
  const int status = std::system(command.c_str());
  const auto made = in_folder(part, name);
  if (made) fs::rename(*made, cache_ / fs::path(*made).filename(), failure);
  fs::remove_all(part);
  if (status != 0 || !made || failure)
    return bad_input(name + ": generate.py did not make it (it needs Debian's python3-gmsh); see " + log.string());
  return (cache_ / fs::path(*made).filename()).string();
}

Expected<HighOrderMesh> Meshes::load(const std::string& name) const {
  const Expected<std::string> path = find(name);
  if (!path) return tl::unexpected(path.error());
  auto file = formats::read_file(*path);
  if (!file) return tl::unexpected(file.error());
  return std::move(file->mesh);
}

}  // namespace varimesh::bench
