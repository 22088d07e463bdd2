// SHA-256 piece by piece: the name of a mesh is the digest of its bytes.
#pragma once

#include <memory>
#include <string>
#include <string_view>

namespace varimesh::server {

/// Takes bytes in order and says their digest.
class Sha256 {
 public:
  Sha256();
  void update(std::string_view bytes);
  /// 64 hexadecimal digits in small letters; call it once, last.
  std::string finish();

 private:
  struct Deleter {
    void operator()(void* context) const;
  };
  std::unique_ptr<void, Deleter> context_;
};

/// Whether `text` has the form of a digest.
bool is_digest(std::string_view text);

}  // namespace varimesh::server
