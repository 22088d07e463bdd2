// SHA-256. The digest of a mesh's bytes is the mesh's name in the service.
#pragma once

#include <memory>
#include <string>
#include <string_view>

namespace varimesh {

/// Computes the SHA-256 of bytes that arrive piece by piece, in order.
class Sha256 {
 public:
  Sha256();
  void update(std::string_view bytes);
  /// Returns the digest as 64 lowercase hexadecimal digits. Call it once, after the last update().
  std::string finish();

 private:
  struct Deleter {
    void operator()(void* context) const;
  };
  std::unique_ptr<void, Deleter> context_;
};

/// Returns the SHA-256 of the bytes as 64 lowercase hexadecimal digits.
std::string sha256(std::string_view bytes);

/// Returns whether `text` has the form of a digest: 64 lowercase hexadecimal digits.
bool is_sha256(std::string_view text);

}  // namespace varimesh
