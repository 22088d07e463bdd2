// What NVIDIA's driver needs in a process that may do nothing else. A process that uses a graphics card has these
// rights beside those of the sandbox (sandbox.h), and no other process has them.
#pragma once

#include <cstdint>

namespace varimesh {

class CallFilter;

/// Descriptors that the driver may open beside those that are open: one for each mapping of a card's memory.
inline constexpr int kDriverDescriptors = 512;
/// Threads that the driver may have.
inline constexpr int kDriverThreads = 16;
/// Memory that the driver may share with the card, in bytes. RLIMIT_DATA does not count it.
inline constexpr std::int64_t kDriverSharedBytes = std::int64_t{2} << 30;

/// From now on this thread, and those that it starts, open only what the driver looks at: libraries (/usr, /lib,
/// LD_LIBRARY_PATH), /sys, a part of /proc, and the files of the cards (/dev/nvidia…), which it may use as well. Call
/// it before the driver is opened. Returns false, with errno, if the system has no Landlock (landlock.h).
bool open_only_files_of_the_driver();

/// Allows the calls that the driver makes after it has made a context: opening files, which
/// open_only_files_of_the_driver() limits, looking for files, its own commands to its files (ioctl), and pipes.
void allow_calls_of_the_driver(CallFilter& filter);

}  // namespace varimesh
