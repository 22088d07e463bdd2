// Where the table's meshes come from.
#pragma once

#include <filesystem>
#include <string>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::bench {

/// Finds meshes by name, or has them made.
class Meshes {
 public:
  /// `cases`: a folder with meshes/ and generate.py; `cache`: where what that makes is kept.
  Meshes(std::filesystem::path cases, std::filesystem::path cache)
      : cases_(std::move(cases)), cache_(std::move(cache)) {}

  /// The path of NAME.msh in meshes/ or in the cache, made by generate.py (with Debian's python3-gmsh) where it is in
  /// neither. Errors: BadInput, saying what is missing.
  Expected<std::string> find(const std::string& name) const;
  /// The mesh in that file. Errors: the same, and what the reader says.
  Expected<HighOrderMesh> load(const std::string& name) const;

 private:
  std::filesystem::path cases_, cache_;
};

}  // namespace varimesh::bench
