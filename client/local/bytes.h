// The bytes of a mesh file in memory, as the service's library takes them.
#pragma once

#include <string>
#include <string_view>
#include <utility>

#include "server/meshes/mesh_store.h"

namespace varimesh::client {

class Bytes : public server::Blob {
 public:
  explicit Bytes(std::string bytes) : bytes_(std::move(bytes)) {}
  std::string_view bytes() const override { return bytes_; }

 private:
  const std::string bytes_;
};

}  // namespace varimesh::client
