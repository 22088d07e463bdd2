// What the process of a job may do: compute, and talk to the server.
#pragma once

#include <cstdint>

namespace varimesh::server {

/// The limits that hold without a filter too: no new rights, no core dump, few more descriptors, SIGKILL when the
/// thread that started this process ends, and the first to go if the machine has no memory left.
/// @param processor_seconds 0: no limit
void limit_this_process(std::int64_t processor_seconds);

/// The size of this process's address space, in bytes; 0 if it is not known.
std::int64_t address_space();

}  // namespace varimesh::server
