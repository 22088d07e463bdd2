// The name of a mesh: the SHA-256 of its bytes.
#pragma once

#include <memory>
#include <string>
#include <string_view>

namespace varimesh::client {

/// Takes bytes in order and says their SHA-256.
class Digest {
 public:
  Digest();
  void update(std::string_view bytes);
  /// 64 hexadecimal digits in small letters; call it once, last.
  std::string finish();

 private:
  std::shared_ptr<void> context_;
};

}  // namespace varimesh::client
