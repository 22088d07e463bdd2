// A build without libcurl knows no buckets.
#include "server/meshes/s3/bucket.h"

namespace varimesh::server {

Expected<std::shared_ptr<MeshPlace>> mesh_bucket(const std::string&, const BucketSettings&) {
  return tl::unexpected(Error{Error::Kind::BadOption,
                              "This varimeshd was built without libcurl and cannot keep meshes in a bucket; name a "
                              "directory with --meshes, or build it with libcurl (Debian package "
                              "libcurl4-openssl-dev)."});
}

}  // namespace varimesh::server
