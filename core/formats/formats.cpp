// The table of formats, and the doors: which reader, which writer, by content and by name.
#include "core/formats/formats.h"

#include <algorithm>
#include <array>
#include <filesystem>

#include "core/formats/gmsh_read.h"
#include "core/formats/gmsh_write.h"
#include "core/formats/vtu.h"

namespace varimesh::formats {

namespace {

constexpr std::array<FormatInfo, 5> kFormats = {{
    {Format::Msh22, "msh22", ".msh", true},
    {Format::Msh22Binary, "msh22-binary", ".msh", true},
    {Format::Msh41, "msh41", ".msh", true},
    {Format::Msh41Binary, "msh41-binary", ".msh", true},
    {Format::Vtu, "vtu", ".vtu", false},
}};

bool starts_with_section(std::string_view bytes) {
  const std::size_t at = bytes.find_first_not_of(" \t\r\n");
  return at != std::string_view::npos && bytes[at] == '$';
}

std::string name_of(Format format) {
  const auto* found =
      std::find_if(kFormats.begin(), kFormats.end(), [&](const FormatInfo& info) { return info.format == format; });
  return found == kFormats.end() ? "auto" : std::string(found->name);
}

// Why the bytes are not a mesh, as far as a look at them tells.
const char* not_a_mesh(std::string_view bytes) {
  if (bytes.empty()) return "The file is empty (0 bytes); a Gmsh MSH 2.2 or 4.1 file was expected.";
  if (bytes.substr(0, 4096).find("<VTKFile") != std::string_view::npos)
    return "The file is a VTK file, which is written but not read: hand in the Gmsh MSH file (2.2 or 4.1).";
  return "The file is not a mesh that can be read: it does not begin with a section such as $MeshFormat (byte 0); a "
         "Gmsh "
         "MSH 2.2 or 4.1 file was expected.";
}

}  // namespace

std::span<const FormatInfo> all() { return kFormats; }

Expected<Format> from_name(std::string_view name) {
  if (name == "auto" || name.empty()) return Format::Auto;
  std::string names = "auto";
  for (const FormatInfo& info : kFormats) {
    if (info.name == name) return info.format;
    names += ", " + std::string(info.name);
  }
  return bad_option("There is no format '" + std::string(name) + "'; there are " + names + ".");
}

Expected<Format> for_output(std::string_view path, Format requested, Format read_as) {
  std::string lower(path);
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return char(std::tolower(c)); });
  const bool vtu = lower.ends_with(".vtu"), msh = lower.ends_with(".msh");
  if (requested != Format::Auto) {
    if (requested == Format::Vtu ? msh : vtu)
      return bad_option("The ending of '" + std::string(path) + "' contradicts the format " + name_of(requested) +
                        ": change one of the two.");
    return requested;
  }
  if (vtu) return Format::Vtu;
  std::error_code error;
  const auto status = std::filesystem::status(std::filesystem::path(path), error);
  const bool special = (!error && std::filesystem::is_other(status)) || path.starts_with("/dev/");
  if (msh || special) return read_as == Format::Auto || read_as == Format::Vtu ? Format::Msh41Binary : read_as;
  return bad_option("The format of '" + std::string(path) +
                    "' is not known from its ending: end it in .msh or .vtu, or name the format.");
}

Expected<MeshFile> read(std::string_view bytes) {
  if (!starts_with_section(bytes)) return bad_input(not_a_mesh(bytes));
  try {
    return read_gmsh(bytes);
  } catch (const ReadFailure& failure) {
    return bad_input(failure.sentence);
  } catch (const std::bad_alloc&) {
    return bad_input("The mesh file cannot be read: it needs more memory than there is.");
  }
}

Expected<void> write(const HighOrderMesh& mesh, Format format, const Sink& sink, std::span<const CellField> fields) {
  if (format == Format::Vtu) return write_vtu(mesh, sink, fields);
  return write_gmsh(mesh, format == Format::Auto ? Format::Msh41Binary : format, sink);
}

}  // namespace varimesh::formats
