// What HOPR's and CGNS files have beside a mesh, which HighOrderMesh::foreign keeps from reading to writing. Internal
// to core/formats and core/hdf.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>

#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// The code of a boundary condition of HOPR: type, curve, state, periodic index.
using HoprCondition = std::array<std::int32_t, 4>;
inline constexpr std::int32_t kHoprPeriodic = 1, kHoprInner = 100;

/// The conditions by the tags of their groups.
void remember_hopr_conditions(HighOrderMesh& mesh, const std::map<int, HoprCondition>& conditions);
std::map<int, HoprCondition> hopr_conditions_of(const HighOrderMesh& mesh);

/// The types of CGNS's boundary conditions, such as BCWall, by the tags of their groups.
void remember_cgns_types(HighOrderMesh& mesh, const std::map<int, std::string>& types);
std::map<int, std::string> cgns_types_of(const HighOrderMesh& mesh);

/// The note that a CGNS file had several zones: their number.
inline constexpr const char* kCgnsZones = "Zones";

}  // namespace varimesh::formats
