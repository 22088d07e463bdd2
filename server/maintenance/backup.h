// Copies a state directory while a server uses it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"

namespace varimesh::server {

/// What a backup contains.
struct BackupReport {
  std::int64_t jobs = 0;
  std::int64_t files = 0;           ///< Meshes, results and checkpoints that jobs refer to.
  std::int64_t copied = 0;          ///< Those that an earlier backup in the same directory did not have.
  std::vector<std::string> damage;  ///< What the state directory itself has lost; one sentence each.
  bool kept_earlier = false;        ///< Because of the damage, the earlier backup was not replaced.
};

/// Copies the jobs of a state directory, and every file that they refer to, to the directory `to`, which is created if
/// it does not exist. The copy is a state directory: a server can be started on it. If `to` holds an earlier backup, it
/// is brought up to date; it stays usable if this is interrupted. The jobs are those of one moment during the call. A
/// checkpoint that the server replaces meanwhile is left out, so its job begins again. While something is damaged, an
/// earlier backup is not replaced, and nothing of it is deleted. Errors: Output if a directory cannot be read or
/// written, if a server uses `to`, or if `to` holds something that is no backup.
Expected<BackupReport> back_up(const std::string& from, const std::string& to);

}  // namespace varimesh::server
