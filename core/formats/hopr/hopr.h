// Reads and writes the HDF5 meshes of HOPR, which FLEXI, GALAEXI, PICLas, FLUXO and HORSES3D read. Internal to
// core/formats. Source: HOPR's user guide, "HOPR HDF5 Curved Mesh Format".
#pragma once

#include <array>
#include <map>

#include "core/base/team.h"
#include "core/formats/formats.h"
#include "core/formats/hdf5/source.h"

namespace varimesh::formats {

/// Whether a file with this root group is a mesh of HOPR.
bool is_hopr(const Hdf5Group& root);

/// Reads a mesh. Zones become physical groups of cells, boundary conditions physical groups of sides with their names,
/// and periodic boundaries periodic links. Throws ReadFailure.
MeshFile read_hopr(Hdf5Source& source, FileAllowance& allowance);

/// Writes a mesh with all that HOPR writes: the sides' neighbours with their orientation, boundary conditions, and the
/// nodes of every element row by row. Errors: BadOption if the mesh is not 3-D, or if more than two cells share a side.
Expected<void> write_hopr(const HighOrderMesh& mesh, Format format, const Sink& sink, std::span<const CellField> fields,
                          const Team& team);

/// The part of write_hopr() that looks at shared sides (check_sides() in formats.h).
Expected<void> check_hopr_sides(const HighOrderMesh& mesh, const Team& team);

/// What a file of HOPR does not have of this mesh: one sentence, or nothing.
std::string not_in_hopr(const HighOrderMesh& mesh);

/// The code of a boundary condition: type, curve, state, periodic index.
using HoprCondition = std::array<std::int32_t, 4>;
inline constexpr std::int32_t kHoprPeriodic = 1, kHoprInner = 100;

/// The conditions by the tags of their groups, which HighOrderMesh::foreign keeps from reading to writing.
void remember_hopr_conditions(HighOrderMesh& mesh, const std::map<int, HoprCondition>& conditions);
std::map<int, HoprCondition> hopr_conditions_of(const HighOrderMesh& mesh);

}  // namespace varimesh::formats
