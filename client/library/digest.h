// The identity of a mesh on a server: the SHA-256 of its bytes.
#pragma once

#include <memory>
#include <string>
#include <string_view>

namespace varimesh::client {

/// Computes the SHA-256 of bytes that arrive in pieces.
class Digest {
 public:
  Digest();
  /// Adds bytes after those of the earlier calls.
  void update(std::string_view bytes);
  /// The digest as 64 lower-case hexadecimal digits. Call it once, after the last update().
  std::string finish();

 private:
  std::shared_ptr<void> context_;
};

}  // namespace varimesh::client
