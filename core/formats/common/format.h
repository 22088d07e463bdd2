// The file formats, and what passes between a format and the table of formats.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "core/base/error.h"
#include "core/base/io/sink.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// The file formats. Flags, the contract and the documentation use the same names.
enum class Format : std::uint8_t {
  Auto,         ///< Reading: by content. Writing: by the ending of the file name; .msh keeps the version that was read.
  Msh22,        ///< Gmsh MSH 2.2, ASCII.
  Msh22Binary,  ///< Gmsh MSH 2.2, binary.
  Msh41,        ///< Gmsh MSH 4.1, ASCII.
  Msh41Binary,  ///< Gmsh MSH 4.1, binary.
  Vtu,          ///< VTK unstructured grid. Written with Lagrange cells and appended zlib data.
  Mfem,         ///< MFEM mesh v1.0 to v1.3, with straight or curved elements.
  Nektar,       ///< Nektar++ XML, as text or compressed.
  Su2,          ///< SU2 mesh: the vertices only, and straight elements. Can only be written.
  Ism,          ///< ISM mesh of HOHQMesh: quadrilaterals or hexahedra with curved sides. Can only be read.
  Hopr,         ///< HDF5 mesh of HOPR, for FLEXI and others: 3-D, every order.
  Cgns,         ///< CGNS in HDF5, orders 1 to 4.
  Pyfr,         ///< PyFR's mesh in HDF5. Can only be written.
  Abaqus,       ///< Abaqus input file, orders 1 and 2. Can only be read.
  Gmf,          ///< GMF (libMeshb), .mesh and .meshb, orders 1 to 4. Can only be read.
  Exodus,       ///< Exodus in HDF5, orders 1 and 2. Can only be read.
};

/// The names of the formats, in the order of Format.
inline constexpr std::array<std::string_view, 16> kFormatNames = {
    "auto", "msh22", "msh22-binary", "msh41", "msh41-binary", "vtu",    "mfem", "nektar",
    "su2",  "ism",   "hopr",         "cgns",  "pyfr",         "abaqus", "gmf",  "exodus"};

/// The name of a format; "auto" for Format::Auto.
constexpr std::string_view format_name(Format format) { return kFormatNames[std::size_t(format)]; }

/// A mesh, and the format from which it was read.
struct MeshFile {
  HighOrderMesh mesh;
  Format format = Format::Auto;
};

/// One number per cell, in the mesh's order, for formats that contain fields. VTU writes them as cell arrays.
struct CellField {
  std::string name;
  std::span<const double> values;
};

}  // namespace varimesh::formats
