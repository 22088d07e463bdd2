#include "core/base/machine_memory.h"

#include <unistd.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <algorithm>
#include <fstream>
#include <string>

namespace varimesh {
namespace {

/// Returns the smallest limit in a group's folder and the folders above it. A file without a number sets no limit.
std::int64_t least_limit(std::filesystem::path folder, const std::filesystem::path& top, std::int64_t least) {
  while (true) {
    for (const char* name : {"memory.max", "memory.high", "memory.limit_in_bytes"}) {
      std::int64_t limit = 0;
      if (std::ifstream file(folder / name); file >> limit && limit > 0) least = std::min(least, limit);
    }
    if (folder == top || !folder.has_relative_path()) return least;
    folder = folder.parent_path();
  }
}

}  // namespace

std::int64_t machine_memory(const std::filesystem::path& root) {
  std::int64_t memory = static_cast<std::int64_t>(::sysconf(_SC_PHYS_PAGES)) * ::sysconf(_SC_PAGESIZE);
  // The lines are "number:controllers:/path". Version 2 has no controllers. In a cgroup namespace the path is "/".
  std::ifstream groups(root / "proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    const auto first = line.find(':'), second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
    const bool unified = controllers == ",,";
    if (!unified && controllers.find(",memory,") == std::string::npos) continue;
    const std::filesystem::path top = root / (unified ? "sys/fs/cgroup" : "sys/fs/cgroup/memory");
    const std::filesystem::path path = std::filesystem::path(line.substr(second + 1)).relative_path();
    memory = least_limit(path.empty() ? top : top / path, top, memory);
  }
  return memory > 0 ? memory / 10 * 9 : 0;
}

void return_large_blocks() {
#ifdef __GLIBC__
  mallopt(M_MMAP_THRESHOLD, 1 << 20);
  // By default the end of the heap is given back from 128 KiB on, and taken again for each piece of a mesh.
  mallopt(M_TRIM_THRESHOLD, 1 << 20);
#endif
}

}  // namespace varimesh
