// Files in, files out: one file a format, and the table of them.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// File formats. The names are those of the flag, the proto and the documentation.
enum class Format : std::uint8_t {
  Auto,         ///< Reading: by content. Writing: by the file name's ending; .msh keeps the version that was read.
  Msh22,        ///< Gmsh MSH 2.2, ASCII.
  Msh22Binary,  ///< Gmsh MSH 2.2, binary.
  Msh41,        ///< Gmsh MSH 4.1, ASCII.
  Msh41Binary,  ///< Gmsh MSH 4.1, binary.
  Vtu,          ///< VTK unstructured grid, Lagrange cells, appended zlib data; written only.
};

struct FormatInfo {
  Format format;
  std::string_view name;       ///< "msh22", "msh22-binary", "msh41", "msh41-binary", "vtu"
  std::string_view extension;  ///< ".msh"
  bool readable;
};

/// Every format but Auto.
std::span<const FormatInfo> all();

/// The format of that name; BadOption lists the names there are.
Expected<Format> from_name(std::string_view name);

/// The format that writing to `path` means: `requested`, or by its ending, with `.msh` standing for `read_as` where
/// that is an MSH format and for Msh41Binary otherwise. What has no ending that is known and is a device or a pipe
/// takes the format of `.msh`. BadOption for any other ending where nothing is requested, and for one that contradicts
/// `requested`.
Expected<Format> for_output(std::string_view path, Format requested, Format read_as);

/// A mesh, and what it was read from.
struct MeshFile {
  HighOrderMesh mesh;
  Format format = Format::Auto;
};

/// Reads a mesh from a file's bytes. Errors: BadInput with the byte (binary) or line (ASCII) where reading stopped.
Expected<MeshFile> read(std::string_view bytes);

/// Reads the file at `path` (memory-mapped); errors name the path.
Expected<MeshFile> read_file(const std::string& path);

/// Takes the file's bytes piece by piece, in order; returns false to stop (a full disk, a broken pipe).
using Sink = std::function<bool(std::string_view)>;

/// A number an element of dimension mesh.dimension, in the mesh's order, for formats that hold fields (VTU cell
/// arrays).
struct CellField {
  std::string name;
  std::span<const double> values;
};

/// Writes the mesh. ASCII numbers have as many significant digits (17 at most) as reading needs to give the same
/// doubles. Errors: BadOption
/// where the format cannot hold the mesh, Output where the sink stopped.
Expected<void> write(const HighOrderMesh& mesh, Format format, const Sink& sink,
                     std::span<const CellField> fields = {});

/// Writes the file as OutputFile does: no half-written file is ever seen under its name.
Expected<void> write_file(const HighOrderMesh& mesh, Format format, const std::string& path,
                          std::span<const CellField> fields = {});

/// Whether `path` can be written, found out before any work is done: OutputFile::check().
Expected<void> check_writable(const std::string& path);

}  // namespace varimesh::formats
