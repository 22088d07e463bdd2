// A place for meshes that several servers share, other than a directory.
#pragma once

#include <memory>
#include <string>

#include "core/base/error.h"
#include "server/meshes/directory_mesh_store.h"

namespace varimesh::server {

/// Errors of all functions: Output if the place cannot be used.
class MeshPlace {
 public:
  virtual ~MeshPlace() = default;
  /// Returns the name of the place: 64 hexadecimal digits that it keeps. They are made if there are none.
  virtual Expected<std::string> name() = 0;
  /// Returns 16 bytes that only those know who may use the place. They are made if there are none.
  virtual Expected<std::string> secret() = 0;
  /// Opens the store. `directory`: of this server, for copies of meshes. `needed`: tells which digests jobs need.
  virtual Expected<std::unique_ptr<MeshStore>> open(const std::string& directory, const DirectoryMeshSettings& settings,
                                                    AskNeeded needed) = 0;
};

}  // namespace varimesh::server
