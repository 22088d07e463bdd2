// What a process may do that reads the bytes of strangers: compute, and use what it has open. All programs of VariMesh
// that do so have this one sandbox.
#pragma once

#include <cstdint>

namespace varimesh {

/// Limits that hold from the beginning, on every system: no new rights, no core dump, SIGKILL when the thread that
/// started this process ends, and the first to go if the machine has no memory left.
void begin_confinement();

/// What a program keeps beside its processors and what it has open.
struct Confinement {
  std::int64_t processor_seconds = 0;  ///< 0: no limit. Then comes SIGXCPU, which names it, and soon SIGKILL.
  std::int64_t memory = 0;             ///< Most address space, in bytes. 0: no limit. See `has_device`.
  bool memory_can_be_raised = false;   ///< Whether the program that started this process may raise `memory`.
  std::int64_t file_bytes = 0;         ///< The most bytes of a file that is open for writing.
  int more_descriptors = 0;            ///< How many may be opened beside those that are open.
  bool threads = false;                ///< Whether threads may be started.
  /// The process has opened a graphics card, after open_only_files_of_the_driver() (driver_rules.h), and goes on using
  /// it. Then it keeps what the driver needs, also in the threads that the driver has started. `memory` counts only
  /// what it can write and shares with nobody (RLIMIT_DATA): a driver reserves more addresses than any machine has
  /// memory.
  bool has_device = false;
  bool has_threads = false;  ///< A driver has started threads. The rules hold for these, too.
  /// The one file that can be opened. Opening this path gives a copy of the descriptor, at the beginning of the file.
  /// If the path is null, no file can be opened. It must live as long as the process.
  const char* path = nullptr;
  int file = -1;
};

/// From now on this process and all its threads have only memory, time and what is open. It can open no files, make no
/// sockets, start no processes, run no code that is not the program's own, and signal nobody. Such calls fail with
/// EPERM. Call it after begin_confinement(), before there is a second thread unless a driver has started it, once.
/// Returns false, with errno, if the system has no filters of system calls: then only the limits hold.
bool confine_this_process(const Confinement& keeps);

}  // namespace varimesh
