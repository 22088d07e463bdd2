// The memory that this process may use.
#pragma once

#include <cstdint>
#include <filesystem>

namespace varimesh {

/// Returns 9/10 of the memory that this process may use, in bytes: the memory of the machine, or the smallest limit of
/// the process's control group and the groups that contain it (version 1 or 2). 0 if that cannot be determined. `root`:
/// the directory that contains proc and sys/fs/cgroup.
std::int64_t machine_memory(const std::filesystem::path& root = "/");

/// From now on, blocks of a mebibyte or more go back to the system as soon as they are freed. By default glibc's
/// allocator keeps blocks of up to 32 MiB, and a run takes up to a tenth more memory than it has in use. For programs,
/// at their start; libraries leave the allocator as it is. It changes nothing with other allocators. Smaller blocks at
/// the end of the heap stay, up to a mebibyte.
void return_large_blocks();

}  // namespace varimesh
