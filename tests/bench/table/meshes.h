// Finds or makes the meshes of the table.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::bench {

/// The name of the mesh that cube_with_hole() makes with about so many tetrahedra or hexahedra of this order.
std::string cube_name(Shape shape, int order, std::int64_t elements);
/// The name of the mesh that perturbed_square() makes with so many cells per side.
std::string square_name(int cells);

/// Finds meshes by name, makes those that have a name from above, or lets generate.py make them.
class Meshes {
 public:
  /// `cases`: a folder that contains meshes/ and generate.py; `cache`: the folder in which made meshes are kept.
  Meshes(std::filesystem::path cases, std::filesystem::path cache)
      : cases_(std::move(cases)), cache_(std::move(cache)) {}

  /// The path of NAME.msh in meshes/ or in the cache. If it is in neither, it is made in the cache. Other meshes than
  /// structured ones are made by generate.py (with Debian's python3-gmsh). Errors: BadInput, which says what is
  /// missing.
  Expected<std::string> find(const std::string& name) const;
  /// The mesh in this file. Errors: the same, and those of the reader.
  Expected<HighOrderMesh> load(const std::string& name) const;
  /// The folder in which made meshes are kept.
  const std::filesystem::path& cache() const { return cache_; }

 private:
  std::filesystem::path cases_, cache_;
};

}  // namespace varimesh::bench
