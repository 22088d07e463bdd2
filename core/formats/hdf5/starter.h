// Who starts varimesh_hdf5. A process that may start no programs asks another one to do it (server/isolation).
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <functional>

namespace varimesh::formats {

/// How the program is to run.
struct Hdf5Start {
  bool writes = false;
  std::int64_t seconds = 0;  ///< Of processor time.
  std::int64_t memory = 0;   ///< In bytes.
};

/// The program that was started: the socket over which it is asked, and its process. The caller closes the socket and
/// ends the process (core/process/helper_program.h).
struct Hdf5Program {
  int socket = -1;  ///< −1: it was not started.
  pid_t id = -1;    ///< −1: it is no process of this one.
  int error = 0;    ///< Why it was not started: errno.
};

/// Starts the program. ENOENT if it is not installed.
Hdf5Program start_hdf5(const Hdf5Start& start);

/// From now on `starter` starts the program, as if it were installed. Call it before anything reads or writes a file.
/// `starter` is called from any thread.
void use_hdf5_starter(std::function<Hdf5Program(const Hdf5Start& start)> starter);

}  // namespace varimesh::formats
