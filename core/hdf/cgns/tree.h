// The tree of nodes that a CGNS file is. Internal to core/formats. Source: CGNS SIDS file mapping manual.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/hdf/content/source.h"

namespace varimesh::formats {

/// The array with a node's data.
inline constexpr const char* kCgnsData = " data";

/// The text of a node's data, which CGNS stores as numbers of one byte.
std::string cgns_text(const Hdf5Group& node);

/// The children with this label, with their names.
std::vector<std::pair<std::string, Hdf5Group>> cgns_children(const Hdf5Group& node, std::string_view label);

/// Where a node's points lie: Vertex, EdgeCenter, FaceCenter, CellCenter.
std::string cgns_location(const Hdf5Group& node);

/// Throws ReadFailure if a coordinate is not finite. `node` counts from 0; `axis` is the coordinate's name in the grid.
void check_cgns_coordinate(const Hdf5Group& grid, const char* axis, std::int64_t node, double coordinate);

}  // namespace varimesh::formats
