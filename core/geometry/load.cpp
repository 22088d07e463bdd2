#include "core/geometry/load.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <unistd.h>

#include <filesystem>
#include <system_error>
#include <utility>

#include "core/base/machine_memory.h"
#include "core/geometry/cad_reader.h"
#include "core/process/helper_program.h"

namespace varimesh::geometry {

std::string plugin_path() { return find_helper("libvarimesh_opencascade.so", "VARIMESH_OPENCASCADE"); }

std::string reader_path(const std::string& plugin) {
  return std::filesystem::path(plugin).replace_filename(kReaderProgram).string();
}

Expected<void> check_plugin(const std::string& what) {
  const std::string plugin = plugin_path();
  if (plugin.empty())
    return bad_option(what +
                      " cannot be read, because VariMesh was installed without OpenCASCADE: libvarimesh_opencascade.so "
                      "is neither beside the program nor named by VARIMESH_OPENCASCADE. Install the package or wheel "
                      "varimesh-geometry, or build VariMesh after 'deploy/setup geometry'.");
  if (::access(reader_path(plugin).c_str(), X_OK) == 0) return {};
  return bad_option(what + " cannot be read, because the program '" + reader_path(plugin) +
                    "', which reads CAD files, is missing; install VariMesh again.");
}

std::int64_t memory_for_reading(std::int64_t file_bytes) {
  // Address space: OpenCASCADE's libraries take .3 GB of it.
  return (std::int64_t{1} << 30) + 100 * file_bytes;
}

Expected<Geometry> CadModel::geometry() const {
  Geometry geometry;
  std::string error;
  geometry.notes = notes_;
  if (!read_(shape_, geometry, error)) return bad_input(what_ + " cannot be used: " + error);
  for (Surface& surface : geometry.surfaces)
    if (const auto name = names_.find(surface.tag); name != names_.end()) surface.name = name->second;
  return geometry;
}

std::int64_t CadModel::memory() const {
  return (std::int64_t{16} << 20) + 20 * static_cast<std::int64_t>(shape_.size());
}

Expected<CadModel> read_model(const std::string& plugin, int file, const std::string& what, std::int64_t most_memory,
                              const StopToken* stop) {
  CadModel model;
  // The library stays loaded, because shapes that it made may live as long as the program.
  void* library = dlopen(plugin.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) return bad_option("OpenCASCADE cannot be loaded: " + std::string(dlerror()) + ".");
  model.read_ = reinterpret_cast<ReadShape*>(dlsym(library, kReadShapeSymbol));
  if (model.read_ == nullptr)
    return bad_option("'" + plugin + "' belongs to another version of VariMesh; install both from the same package.");
  auto read = read_in_child(reader_path(plugin), ReaderTask::Shape, file, what, most_memory, stop);
  if (!read) return tl::unexpected(read.error());
  model.shape_ = std::move(read->made);
  model.notes_ = std::move(read->notes);
  model.names_ = std::move(read->names);
  model.what_ = what;
  return model;
}

Expected<ModelTriangles> read_triangles(const std::string& plugin, int file, const std::string& what,
                                        std::int64_t most_memory) {
  auto read = read_in_child(reader_path(plugin), ReaderTask::Triangles, file, what, most_memory);
  if (!read) return tl::unexpected(read.error());
  auto faces = decode_faces(read->made);
  if (!faces || faces->empty())
    return bad_input(what + " cannot be used: its reader ended without a picture of it; export it again, as STEP.");
  for (FaceTriangles& face : *faces)
    if (const auto name = read->names.find(face.tag); name != read->names.end()) face.name = name->second;
  return ModelTriangles{std::move(*faces), std::move(read->notes)};
}

Expected<CadModel> read_model(int file, const std::string& what, const StopToken* stop) {
  if (const auto reads = check_plugin(what); !reads) return tl::unexpected(reads.error());
  return read_model(plugin_path(), file, what, machine_memory(), stop);
}

Expected<Geometry> load(const std::string& path) {
  const std::string what = "The geometry '" + path + "'";
  std::error_code failed;
  const bool is_file = std::filesystem::is_regular_file(path, failed);
  const int file = is_file ? ::open(path.c_str(), O_RDONLY | O_CLOEXEC) : -1;
  if (file < 0) return bad_input(what + " is not a file that can be read; check the name.");
  const auto model = read_model(file, what);
  ::close(file);
  if (!model) return tl::unexpected(model.error());
  return model->geometry();
}

}  // namespace varimesh::geometry
