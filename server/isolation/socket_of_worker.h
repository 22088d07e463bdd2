// The open file with which the process of a job starts.
#pragma once

namespace varimesh::server {

/// The socket to the server.
inline constexpr int kWorkerSocket = 3;

}  // namespace varimesh::server
