// A map of counts under a lock.
#include "server/streams/peer_counts.h"

namespace varimesh::server {

std::shared_ptr<const void> PeerCounts::take(const std::string& address) {
  std::lock_guard lock(mutex_);
  int& open = open_[address];
  if (most_ > 0 && open >= most_) return nullptr;
  ++open;
  return {this, [address](PeerCounts* counts) { counts->give_back(address); }};
}

void PeerCounts::give_back(const std::string& address) {
  std::lock_guard lock(mutex_);
  const auto found = open_.find(address);
  if (--found->second == 0) open_.erase(found);
}

}  // namespace varimesh::server
