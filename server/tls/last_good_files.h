// The newest files of TLS that can be used, whatever happens to the files themselves.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "server/tls/tls.h"

namespace varimesh::server {

/// Copies the files of TLS into memory and checks the copies. A file that is read while it is written, or that is
/// broken, changes nothing: gRPC would take it as it is, and then no new connection would succeed. One thread at a time
/// calls refresh().
class LastGoodFiles {
 public:
  /// Errors: as check_tls_files().
  static Expected<std::unique_ptr<LastGoodFiles>> of(const TlsFiles& files);
  ~LastGoodFiles();
  LastGoodFiles(const LastGoodFiles&) = delete;
  LastGoodFiles& operator=(const LastGoodFiles&) = delete;

  /// Paths that lead to the copies as long as this object exists.
  const TlsFiles& copies() const { return copies_; }
  /// Copies the files again if they have changed, and returns whether it did. Errors: as check_tls_files(), once for
  /// each change and then once a minute; the copies stay as they were.
  Expected<bool> refresh();

 private:
  static constexpr std::size_t kFiles = 3;  ///< The certificate, the key, the authority.
  using Descriptors = std::array<int, kFiles>;
  /// What shows that a file has changed: time, size and inode of each.
  using Version = std::array<std::int64_t, 3 * kFiles>;

  explicit LastGoodFiles(TlsFiles files) : files_(std::move(files)) { copied_.fill(-1); }
  Version version() const;
  /// Returns the descriptors of checked copies. The descriptor of a file that is not given is −1.
  Expected<Descriptors> copy() const;

  const TlsFiles files_;
  TlsFiles copies_;
  Descriptors copied_;
  Version seen_{};
  std::chrono::steady_clock::time_point checked_;
};

}  // namespace varimesh::server
