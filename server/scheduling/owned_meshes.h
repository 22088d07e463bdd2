// Which meshes the jobs of each owner have, so that a question for one does not look at all jobs.
#pragma once

#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "server/meshes/mesh_store.h"

namespace varimesh::server {

/// Counts how many jobs of an owner have a mesh as an input or a result, if only this process uses the store.
/// Thread-safe.
class OwnedMeshes {
 public:
  explicit OwnedMeshes(MeshStore& meshes) : meshes_(meshes) {}

  /// A job of the owner has these meshes, or is about to, and they therefore belong to the owner.
  void add(const std::string& owner, const std::vector<std::string>& digests) {
    std::unique_lock lock(mutex_, std::defer_lock);
    if (counts()) lock.lock();  // a place that servers share may let this wait
    for (const std::string& digest : digests) {
      if (counts()) ++counts_[{owner, digest}];
      meshes_.grant(digest, owner);
    }
  }
  /// A job that had these meshes is gone, or does not have them after all. A mesh that no job of the owner has any more
  /// does not belong to the owner either, unless the owner has uploaded it: that another owner has it as well must not
  /// show.
  void remove(const std::string& owner, const std::vector<std::string>& digests) {
    const std::scoped_lock lock(mutex_);
    for (const std::string& digest : digests) {
      const auto found = counts_.find({owner, digest});
      if (found == counts_.end() || --found->second > 0) continue;
      counts_.erase(found);
      meshes_.revoke(digest, owner);
    }
  }
  bool has(const std::string& owner, const std::string& digest) {
    const std::scoped_lock lock(mutex_);
    return counts_.contains({owner, digest});
  }

 private:
  bool counts() const { return meshes_.counts_references(); }

  MeshStore& meshes_;
  std::mutex mutex_;
  std::map<std::pair<std::string, std::string>, int> counts_;
};

}  // namespace varimesh::server
