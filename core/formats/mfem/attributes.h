// The attributes and attribute sets of MFEM that stand for physical groups. Internal to core/formats.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/io/buffered_output.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// Attributes are from 1 to this. Tags of groups that are no attributes follow the largest attribute, and must be an
/// int too.
inline constexpr int kMostAttribute = 1'000'000'000;

/// The attributes of the elements of one dimension. Elements that are in the same physical groups have the same one.
struct MfemAttributes {
  std::vector<int> of_block;  ///< One positive attribute per block of the mesh; 0 for blocks of another dimension.
  /// The attributes of each set, in the order of the physical groups: one set per group with a name, and per group
  /// without a name that is not the first group of its elements.
  std::vector<std::pair<std::string, std::vector<int>>> sets;
};

/// Chooses the attributes: the tag of the elements' first group, or the tag of their entity if they are in no group. If
/// two kinds of elements would have the same attribute, the second gets one that is free.
MfemAttributes mfem_attributes(const HighOrderMesh& mesh, int dimension);

/// Writes the sets as the section of this name.
void write_mfem_sets(std::string_view section, const MfemAttributes& attributes, BufferedOutput& out);

}  // namespace varimesh::formats
