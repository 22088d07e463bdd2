// A directory in which several servers keep objects at the same time.
#pragma once

#include <memory>
#include <string>

#include "server/meshes/shared/shared_mesh_store.h"

namespace varimesh::server {

/// Opens a store of meshes in a directory, which may be on a network drive. `scratch`: a directory of this server for
/// copies of large meshes, which are deleted when they are closed. `needed`: tells which digests jobs need. Errors:
/// UNAVAILABLE if the directory cannot be used.
///
/// Each object is a file with its name. The tag of an object is the time of change of its file. Besides, `name` has the
/// directory's name, part-NAME is being written, and upload-KEY has the bytes that an upload has received. A lock on a
/// mesh holds off those who use, replace or delete it; a lock on upload-KEY.about, the other streams of an upload at
/// all servers; the server that has locked the file `sweeper` sweeps.
///
/// The directory's file system must rename files atomically and lock them with flock(), as ext4, xfs and NFS 4 do.
Answer<std::unique_ptr<SharedMeshStore>> open_shared_directory(const std::string& directory, const std::string& scratch,
                                                               DirectoryMeshSettings settings, AskNeeded needed);

}  // namespace varimesh::server
