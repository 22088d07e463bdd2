// Nektar++'s composites: lists of elements, faces or edges, which are VariMesh's physical groups. Internal to
// core/formats.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/base/io/buffered_output.h"
#include "core/formats/nektar/file.h"

namespace varimesh::formats {

/// What the composites of a file say.
struct NektarGroups {
  /// The tags of each element, as an index in `lists`. List 0 is empty.
  std::vector<std::int32_t> of_elements;
  std::vector<std::vector<int>> lists{{}};
  /// The faces (3-D) or edges (2-D) that are in a composite, by their position in the file, with their tags. In the
  /// order of the composites.
  std::vector<std::pair<std::int32_t, std::vector<int>>> of_sides;
  std::vector<PhysicalGroup> named;
};

/// Reads the composites. Composite 0 gets the first tag above all others, because 0 is no tag. Composites of vertices,
/// and in 3-D of edges, are left out. Throws ReadFailure.
NektarGroups nektar_groups(NektarFile& file, FileAllowance& allowance);

/// Names of composites that are no groups: elements in no group, and all cells if groups overlap, because every cell
/// must be in the domain once.
inline constexpr std::string_view kNektarUngrouped = "varimesh:ungrouped", kNektarWholeDomain = "varimesh:domain";

/// The composites that a mesh is written with.
struct NektarComposites {
  /// A composite: its number, name, dimension, and the blocks whose elements it has.
  struct One {
    int id = 0;
    std::string name;
    int dimension = 0;
    std::vector<std::size_t> blocks;
  };
  std::vector<One> all;
  std::string domain;  ///< Numbers of composites that have every cell once, as Nektar++ writes lists.
};
NektarComposites nektar_composites(const HighOrderMesh& mesh);

class NektarGrid;

/// Writes the composites, the domain, the end of the geometry and everything outside the geometry.
void write_nektar_sections(const NektarGrid& grid, BufferedOutput& out);

}  // namespace varimesh::formats
