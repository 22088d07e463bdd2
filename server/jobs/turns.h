// Whose job is next.
#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace varimesh::server {

/// Peers take turns, so that nobody waits for all jobs of somebody else. The next peer is the one with the fewest
/// running jobs; among equals, the one whose last turn was longest ago. Not thread-safe. Turns are forgotten with the
/// process.
class Turns {
 public:
  /// Returns the next peer of those that wait; nullptr if none does. `waiting`: how many jobs of each run.
  const std::string* next(const std::map<std::string, int>& waiting) const {
    const std::string* best = nullptr;
    std::pair<int, std::int64_t> least;
    for (const auto& [peer, running] : waiting) {
      const auto served = served_.find(peer);
      const std::pair place{running, served == served_.end() ? 0 : served->second};
      if (best != nullptr && place >= least) continue;
      best = &peer;
      least = place;
    }
    return best;
  }

  /// Notes that it was the peer's turn.
  void take(const std::string& peer) {
    if (served_.size() >= kMostRemembered) served_.clear();
    served_[peer] = ++turn_;
  }

 private:
  static constexpr std::size_t kMostRemembered = 100'000;

  std::map<std::string, std::int64_t> served_;  ///< The last turn of each peer.
  std::int64_t turn_ = 0;
};

}  // namespace varimesh::server
