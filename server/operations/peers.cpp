// A map of counts.
#include "server/operations/peers.h"

namespace varimesh::server {

std::string peer_address(const std::string& peer) {
  const auto scheme = peer.find(':');
  const std::string kind = peer.substr(0, scheme);
  if (scheme == std::string::npos || (kind != "ipv4" && kind != "ipv6")) return kind;
  std::string address = peer.substr(scheme + 1, peer.rfind(':') - scheme - 1);
  for (const std::string bracket : {"[", "]", "%5B", "%5D"})
    if (const auto at = address.find(bracket); at != std::string::npos) address.erase(at, bracket.size());
  return address;
}

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
