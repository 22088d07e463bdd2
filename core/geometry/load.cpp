#include "core/geometry/load.h"

#include <dlfcn.h>

#include <cstdlib>
#include <filesystem>
#include <system_error>

#include "core/geometry/cad_reader.h"
#include "core/geometry/plugin.h"

namespace varimesh::geometry {

std::string plugin_path() {
  namespace fs = std::filesystem;
  constexpr const char* kFile = "libvarimesh_opencascade.so";
  std::error_code ignored;
  if (const char* named = std::getenv("VARIMESH_OPENCASCADE"); named != nullptr && *named != '\0')
    return fs::is_regular_file(named, ignored) ? named : "";
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
  if (program.empty()) return "";
  for (const fs::path& folder : {program.parent_path(), program.parent_path().parent_path() / "lib" / "varimesh"})
    if (fs::is_regular_file(folder / kFile, ignored)) return (folder / kFile).string();
  return "";
}

Expected<Geometry> load(const std::string& path) {
  std::error_code failed;
  if (!std::filesystem::is_regular_file(path, failed))
    return bad_input("The geometry '" + path + "' is not a file that can be read; check the name.");
  const std::string plugin = plugin_path();
  if (plugin.empty())
    return bad_option(
        "The geometry '" + path +
        "' cannot be read, because VariMesh was installed without OpenCASCADE: libvarimesh_opencascade.so "
        "is neither beside the program nor named by VARIMESH_OPENCASCADE. Build VariMesh with the packages "
        "of the group 'geometry' of deploy/packages.");
  // The library stays loaded, because shapes that it made may live as long as the program.
  void* library = dlopen(plugin.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) return bad_option("OpenCASCADE cannot be loaded: " + std::string(dlerror()) + ".");
  auto* read = reinterpret_cast<ReadFile*>(dlsym(library, kReadFileSymbol));
  if (read == nullptr)
    return bad_option("'" + plugin + "' belongs to another version of VariMesh; install both from the same package.");
  const auto shape = read_in_child(std::filesystem::path(plugin).replace_filename(kReaderProgram).string(), path);
  if (!shape) return tl::unexpected(shape.error());
  Geometry geometry;
  std::string error;
  if (!read(shape->path(), geometry, error)) return bad_input("The geometry '" + path + "' cannot be used: " + error);
  return geometry;
}

}  // namespace varimesh::geometry
