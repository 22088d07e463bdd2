// The memory that this process may use.
#pragma once

#include <cstdint>
#include <filesystem>

namespace varimesh {

/// Returns 9/10 of the memory that this process may use, in bytes: the memory of the machine, or the smallest limit of
/// the process's control group and the groups that contain it (version 1 or 2). 0 if that cannot be determined. `root`:
/// the directory that contains proc and sys/fs/cgroup.
std::int64_t machine_memory(const std::filesystem::path& root = "/");

}  // namespace varimesh
