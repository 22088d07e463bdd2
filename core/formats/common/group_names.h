// The names of groups by their tags. Internal to core/formats and core/hdf.
#pragma once

#include <map>
#include <string_view>

#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// The names of the groups of this dimension that have one. If several groups have a tag, the last one counts.
inline std::map<int, std::string_view> group_names(const HighOrderMesh& mesh, int dimension) {
  std::map<int, std::string_view> names;
  for (const PhysicalGroup& group : mesh.physical_groups)
    if (group.dimension == dimension && !group.name.empty()) names[group.tag] = group.name;
  return names;
}

}  // namespace varimesh::formats
