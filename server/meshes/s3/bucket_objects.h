// Objects in a bucket that several servers use at the same time.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/meshes/s3/client.h"
#include "server/meshes/shared/object_store.h"

namespace varimesh::server {

/// Makes a store of objects in a bucket, with copies of the meshes in use in a directory of this server, of at most
/// `max_cache_bytes` in all. `log` is told of damaged meshes.
///
/// Keys, below the prefix of the address:
///
///   meshes/DIGEST/g-COPY        the bytes; each upload or result that finds none stores a copy with a new random name
///   meshes/DIGEST/x-COPY-NAME   somebody, NAME, is about to delete this copy
///   meshes/DIGEST/used          random, written anew with each use; its tag is that of the mesh
///   meshes/DIGEST/kept          the note DIGEST.kept
///   meshes/DIGEST/o-MARK        the note DIGEST.MARK
///   uploads/KEY/about           upload-KEY.about
///   uploads/KEY/p-OFFSET        a part of an upload
///   sweeper                     random, written anew by the server that sweeps, each time it does
///   damaged/DIGEST-COPY         a copy whose bytes had changed
///
/// A bucket has no locks, but a read sees every write that was answered before it. Deleting and using a mesh rely on
/// that, as Dekker's algorithm does: who uses it writes `used` and then looks for x-; who deletes it writes x- and then
/// looks whether `used` is what it was, and asks the database again. At least one of them sees the other, however slow
/// either is, and whatever the clocks say. Somebody who sees an x- treats that copy as gone. Nobody removes the x- of
/// another, so that several servers may sweep at once.
std::unique_ptr<ObjectStore> bucket_objects(std::shared_ptr<S3Client> client, const std::string& directory,
                                            std::int64_t max_cache_bytes, std::function<void(const std::string&)> log);

}  // namespace varimesh::server
