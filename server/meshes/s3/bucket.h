// Meshes in a bucket of an S3 server, for varimeshd. The headers of the store itself are not needed for that.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/meshes/mesh_place.h"
#include "server/meshes/s3/address.h"

namespace varimesh::server {

struct BucketSettings {
  std::int64_t max_cache_bytes = std::int64_t{4} << 30;  ///< Of the copies of meshes on this server's disk.
  bool runs_jobs = true;  ///< A job waits for the bucket as long as it takes; a client, for ten seconds.
  std::function<void(const std::string&)> log = [](const std::string&) {};
};

/// Returns the place that an address names, without calling it. Errors: BadOption if the address cannot be used, if
/// there are no credentials, or if this build knows no buckets.
Expected<std::shared_ptr<MeshPlace>> mesh_bucket(const std::string& address, const BucketSettings& settings);

}  // namespace varimesh::server
