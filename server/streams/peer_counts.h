// Limits on what one caller may have open at a time.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>

namespace varimesh::server {

/// Counts how many things of one kind (watches, uploads) each address has open. Thread-safe.
class PeerCounts {
 public:
  /// `most`: how many one address may have open. 0: no limit.
  explicit PeerCounts(int most) : most_(most) {}

  int most() const { return most_; }
  /// Counts one more for the address until the returned pointer is released, which must happen before this object is
  /// destroyed. Null if the address already has as many open as it may have.
  std::shared_ptr<const void> take(const std::string& address);

 private:
  void give_back(const std::string& address);

  const int most_;
  std::mutex mutex_;
  std::map<std::string, int> open_;  ///< Addresses that have at least one open.
};

}  // namespace varimesh::server
