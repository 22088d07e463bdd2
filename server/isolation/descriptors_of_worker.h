// The open files with which the process of a job starts.
#pragma once

namespace varimesh::server {

inline constexpr int kWorkerSocket = 3, kWorkerMesh = 4, kWorkerCheckpoint = 5;

}  // namespace varimesh::server
