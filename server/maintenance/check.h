// Compares everything in a state directory with its digests and check sums.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"

namespace varimesh::server {

/// What was found in a state directory.
struct CheckReport {
  std::vector<std::string> damage;  ///< One sentence each.
  std::int64_t jobs = 0;
  std::int64_t files = 0;         ///< Of meshes and results, that are whole.
  std::int64_t unreferenced = 0;  ///< Those of them that no job refers to; the server deletes them after a while.
};

/// Reads every row of the database and every file of the meshes. `repair`: moves damaged files to the folder 'damaged'
/// of the directory, so that the server takes them again, takes damaged jobs out of the queue, and makes damaged
/// indices of the database anew. Errors: Output if the directory is not one of a server, or if a server uses it.
Expected<CheckReport> check_state(const std::string& directory, bool repair);

}  // namespace varimesh::server
