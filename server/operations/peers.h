// Who asks, and how much of the server one of them may have.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>

namespace varimesh::server {

/// The address of gRPC's "ipv4:10.0.0.7:50312" or "ipv6:%5B::1%5D:50312" without its port; "unix" for a socket.
std::string peer_address(const std::string& peer);

/// Counts what each peer has open. From any thread.
class PeerCounts {
 public:
  /// `most` of one peer; 0: no limit.
  explicit PeerCounts(int most) : most_(most) {}

  int most() const { return most_; }
  /// Held as long as the thing is open, and within the life of this; null where the peer has too many already.
  std::shared_ptr<const void> take(const std::string& address);

 private:
  void give_back(const std::string& address);

  const int most_;
  std::mutex mutex_;
  std::map<std::string, int> open_;  ///< Those that have some.
};

}  // namespace varimesh::server
