// Finds or makes the meshes of the table.
#pragma once

#include <filesystem>
#include <string>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::bench {

/// Finds meshes by name, or lets generate.py make them.
class Meshes {
 public:
  /// `cases`: a folder that contains meshes/ and generate.py; `cache`: the folder in which made meshes are kept.
  Meshes(std::filesystem::path cases, std::filesystem::path cache)
      : cases_(std::move(cases)), cache_(std::move(cache)) {}

  /// The path of NAME.msh in meshes/ or in the cache. If it is in neither, generate.py makes it (with Debian's
  /// python3-gmsh). Errors: BadInput, which says what is missing.
  Expected<std::string> find(const std::string& name) const;
  /// The mesh in this file. Errors: the same, and those of the reader.
  Expected<HighOrderMesh> load(const std::string& name) const;

 private:
  std::filesystem::path cases_, cache_;
};

}  // namespace varimesh::bench
