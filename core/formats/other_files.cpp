// The first bytes of files of other programs, and what turns such a file into one that can be read.
#include "core/formats/other_files.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <cstring>

#include "core/geometry/cad/file_kind.h"

namespace varimesh::formats {

namespace {

using namespace std::string_view_literals;

struct OtherFile {
  std::string_view begins;  ///< The first bytes, after white space.
  std::string_view is;      ///< What the file is.
  std::string_view run;     ///< What to do with it.
};

constexpr std::string_view kMeshIt =
    "make a mesh of it first, for example with: gmsh FILE -3 -order 3 -format msh41 -o mesh.msh (-2 for a plane)";
constexpr std::string_view kMeshInside =
    "mesh its inside with Gmsh: merge the file, make a volume of its surface, and run -3 (tutorial t13 of Gmsh)";
constexpr std::string_view kMeshSurface =
    "make an STL file of it with: meshio convert FILE surface.stl; then mesh its inside with Gmsh (tutorial t13 of "
    "Gmsh)";
constexpr std::string_view kGmshConverts = "convert it, for example with: gmsh FILE -save -format msh41 -o mesh.msh";
constexpr std::string_view kVtu = "make a VTU file of it, for example with: meshio convert FILE mesh.vtu";
constexpr std::string_view kMeshioConverts =
    "convert it, for example with: meshio convert FILE mesh.msh --output-format gmsh; better, give VariMesh the MSH "
    "file from which it was made, because other formats lose curved elements or groups";

constexpr std::string_view kObj = "v ";

constexpr std::array kOtherFiles{
    OtherFile{"# vtk DataFile", "a VTK file of the legacy format", kVtu},
    OtherFile{"<Xdmf", "an XDMF file", kMeshioConverts},
    OtherFile{"<?xml", "an XML file, such as XDMF", kMeshioConverts},
    OtherFile{"NDIME", "an SU2 mesh", kGmshConverts},
    OtherFile{"$", "a Nastran file", kGmshConverts},
    OtherFile{"BEGIN BULK", "a Nastran file", kGmshConverts},
    OtherFile{"-1\n", "a UNV file (universal format of I-DEAS)", kGmshConverts},
    OtherFile{"-1\r\n", "a UNV file (universal format of I-DEAS)", kGmshConverts},
    OtherFile{"solid ", "an STL file, which is a surface of flat triangles and not a volume mesh", kMeshInside},
    OtherFile{kObj, "an OBJ file, which is a surface of flat facets and not a volume mesh", kMeshSurface},
    OtherFile{"@(#)ADF Database"sv, "a CGNS file of the old kind, ADF",
              "convert it to HDF5, with: adf2hdf FILE mesh.cgns"},
    OtherFile{"\x1f\x8b"sv, "a compressed file", "uncompress it with: gunzip FILE"},
    OtherFile{"PK\x03\x04"sv, "a ZIP archive", "unpack it with: unzip FILE"},
};

/// What to say of the kind of CAD file that begins with these bytes; null if no kind does.
const OtherFile* cad_file(std::string_view bytes) {
  static constexpr OtherFile kStep{{}, "a STEP file, which is a geometry and not a mesh", kMeshIt};
  static constexpr OtherFile kIges{{}, "an IGES file, which is a geometry and not a mesh", kMeshIt};
  static constexpr OtherFile kBrep{{}, "a BREP file, which is a geometry and not a mesh", kMeshIt};
  switch (geometry::kind_of_cad_file(bytes)) {
    case geometry::CadFileKind::Step:
      return &kStep;
    case geometry::CadFileKind::Iges:
      return &kIges;
    case geometry::CadFileKind::Brep:
    case geometry::CadFileKind::Binary:
      return &kBrep;
    case geometry::CadFileKind::Unknown:
      break;
  }
  return nullptr;
}

/// A binary STL file has 80 bytes of anything, the number of triangles, and 50 bytes per triangle.
bool is_binary_stl(std::string_view bytes) {
  constexpr std::size_t kHeader = 84, kTriangle = 50;
  if (bytes.size() < kHeader + kTriangle) return false;
  std::uint32_t triangles = 0;
  std::memcpy(&triangles, bytes.data() + 80, sizeof triangles);
  return bytes.size() == kHeader + kTriangle * triangles;
}

/// Whether the first line that is no comment gives a vertex, a name or a library of materials.
bool is_obj(std::string_view text) {
  while (text.starts_with('#') || text.starts_with('\n') || text.starts_with('\r'))
    text.remove_prefix(std::min(text.size(), std::min(text.find('\n'), text.size()) + 1));
  return text.starts_with(kObj) || text.starts_with("mtllib ") || text.starts_with("o ");
}

const OtherFile* find(std::string_view bytes) {
  if (const OtherFile* model = cad_file(bytes)) return model;
  std::string_view text = bytes;
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);  // the mark of UTF-8
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.front())) != 0) text.remove_prefix(1);
  // Every XML file may begin with a declaration; what it is stands in its first element.
  if (text.starts_with("<?xml"))
    for (const OtherFile& file : kOtherFiles)
      if (file.begins.front() == '<' && file.begins != "<?xml" &&
          text.substr(0, 4096).find(file.begins) != std::string_view::npos)
        return &file;
  for (const OtherFile& file : kOtherFiles)
    if (bytes.starts_with(file.begins) || text.starts_with(file.begins)) return &file;
  const auto known = [](std::string_view begins) {
    return std::find_if(kOtherFiles.begin(), kOtherFiles.end(),
                        [&](const auto& file) { return file.begins == begins; });
  };
  if (is_obj(text)) return known(kObj);
  return is_binary_stl(bytes) ? known("solid ") : nullptr;
}

}  // namespace

std::string why_not_a_mesh(std::string_view bytes) {
  constexpr const char* kExpected =
      "a Gmsh MSH file (versions 2.0 to 4.1), an MFEM mesh, a Nektar++ file, a VTU file, an ISM mesh, a mesh of HOPR, "
      "a "
      "CGNS, Exodus or Abaqus file or a GMF mesh was expected.";
  if (bytes.empty()) return std::string("The file is empty (0 bytes); ") + kExpected;
  if (const OtherFile* file = find(bytes))
    return "The file is " + std::string(file->is) + "; " + std::string(file->run) + ".";
  return std::string(
             "The file is not a mesh that can be read: it does not begin with a section such as $MeshFormat (byte "
             "0); ") +
         kExpected +
         " If another program wrote the file, let it write MSH, or convert the file, for example with: meshio convert "
         "FILE "
         "mesh.msh --output-format gmsh.";
}

}  // namespace varimesh::formats
