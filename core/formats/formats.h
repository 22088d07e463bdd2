// Reads and writes mesh files, and knows the file formats.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "core/base/error.h"
#include "core/base/machine_memory.h"
#include "core/base/stop_token.h"
#include "core/formats/common/format.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

struct FormatInfo {
  Format format;
  std::string_view name;       ///< For example "msh41-binary".
  std::string_view extension;  ///< The ending of file names, for example ".msh".
  bool readable;               ///< Whether files of this format can be read.
  bool writable;               ///< Whether they can be written.
};

/// All formats except Auto.
std::span<const FormatInfo> all();

/// The format with this name. Errors: BadOption, which lists the names.
Expected<Format> from_name(std::string_view name);

/// The format in which to write to `path`: `requested`, or the format of the ending if `requested` is Auto.
///   .vtu                  Vtu
///   .mesh                 Mfem
///   .xml                  Nektar
///   .su2                  Su2
///   .h5                   Hopr
///   .cgns                 Cgns
///   .pyfrm                Pyfr
///   .msh                  `read_as` if that is an MSH format, otherwise Msh41Binary
///   a device or a pipe    as .msh, unless it has a known ending
/// Errors: BadOption if the ending contradicts `requested`, or if nothing is requested and the ending is unknown.
Expected<Format> for_output(std::string_view path, Format requested, Format read_as);

/// A format of the bytes' family, by the way they begin: for example one of the MSH formats. Auto if no format that can
/// be read begins so.
Format recognised(std::string_view bytes);

/// Whether only the program varimesh_hdf5 reads and writes files of this format: they are HDF5 files.
constexpr bool needs_hdf5(Format format) {
  return format == Format::Hopr || format == Format::Cgns || format == Format::Pyfr || format == Format::Exodus;
}

/// Whether the program varimesh_hdf5 is there, which may be left out of an installation. Without it, no format that
/// needs_hdf5() can be read or written.
bool has_hdf5();

/// Reads a mesh from the bytes of a file. Errors: BadInput, with the byte (binary) or line (ASCII) where reading
/// stopped; the first one in the file, for any number of threads. Takes at most most_memory_to_read().
/// @param threads how many threads share the work; 0: as many as the machine has
/// @param stop    if it asks to stop, reading ends soon, with an error; may be null
Expected<MeshFile> read(std::string_view bytes, int threads = 1, const StopToken* stop = nullptr);

/// The most memory that reading a file of this size takes with this number of threads, in bytes, besides the file. A
/// file that asks for more is refused: most meshes take less than their files, but damaged and malicious files announce
/// what they do not contain.
constexpr std::int64_t most_memory_to_read(std::int64_t file_bytes, int threads = 1) {
  constexpr int kThreads = 6;  // each further one takes 4 MiB for the pieces that it works on
  return 8 * file_bytes + (std::int64_t{64} << 20) +
         (std::int64_t{4} << 20) * (threads > kThreads ? threads - kThreads : 0);
}

/// The least memory that the mesh of a file of this size takes, in bytes. A text file takes the most bytes for what it
/// contains: nearly five times as many as memory for a tetrahedron whose nodes have numbers of ten digits.
constexpr std::int64_t least_memory(std::int64_t file_bytes) { return file_bytes / 5; }

/// Refuses files whose mesh takes more than `memory` bytes, before they are read. `memory` 0: no limit. Errors:
/// BadInput.
Expected<void> check_memory(std::int64_t file_bytes, std::int64_t memory);

/// Reads the file at `path`, which is mapped into memory. Errors: as for read() and check_memory(), and they name the
/// path.
/// @param memory the bytes that the mesh may take; 0: no limit
/// @param threads how many threads share the work; 0: as many as the machine has
Expected<MeshFile> read_file(const std::string& path, std::int64_t memory = machine_memory(), int threads = 1);

/// Writes the mesh. ASCII numbers have the digits, 17 at most, that are needed to read the same doubles again. Errors:
/// BadOption if the format cannot contain the mesh, Output if the sink stopped. The bytes do not depend on the number
/// of threads.
/// @param threads how many threads share the work; 0: as many as the machine has
Expected<void> write(const HighOrderMesh& mesh, Format format, const Sink& sink, std::span<const CellField> fields = {},
                     int threads = 1);

/// One sentence that names what a file of this format does not have of the mesh: groups, numbers, elements of lower
/// dimension. Empty if it has everything.
std::string left_out(const HighOrderMesh& mesh, Format format);

/// Checks whether a file of this format can hold the way in which elements share their sides. write() would refuse the
/// mesh too, but a run does not change this, so it can be known before. Errors: BadOption, with the sentence of
/// write().
/// @param threads how many threads share the work; 0: as many as the machine has
Expected<void> check_sides(const HighOrderMesh& mesh, Format format, int threads = 1);

/// Writes a file as OutputFile does: an incomplete file never has the name `path`.
Expected<void> write_file(const HighOrderMesh& mesh, Format format, const std::string& path,
                          std::span<const CellField> fields = {}, int threads = 1);

/// Checks, before any work is done, whether a file can be written to `path`: OutputFile::check().
Expected<void> check_writable(const std::string& path);

}  // namespace varimesh::formats
