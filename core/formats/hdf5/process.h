// Starts varimesh_hdf5, the program that reads and writes HDF5 files, and exchanges bytes with it. Internal to
// core/formats.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "core/base/stop_token.h"

namespace varimesh::formats {

/// What went wrong, as a part of a sentence without its end.
struct Hdf5Failure {
  std::string reason;
  bool missing = false;  ///< The program is not installed.
};

/// Where the program is: VARIMESH_HDF5, beside this program, or in the folder lib/varimesh beside this program's
/// folder. Empty if it is not installed.
std::string hdf5_program();

/// The program, which runs while this object lives. It may take a minute of processor time, and a second more for each
/// 2.5 MB of what it is given.
class Hdf5Process {
 public:
  /// @param bytes  how many bytes the file or the mesh has that it is given
  /// @param memory the most memory that it may take, in bytes
  /// @param stop   may be null; if it asks to stop, send() and receive() throw Interrupted
  /// Throws Hdf5Failure.
  Hdf5Process(bool writes, std::int64_t bytes, std::int64_t memory, const StopToken* stop);
  ~Hdf5Process();
  Hdf5Process(const Hdf5Process&) = delete;
  Hdf5Process& operator=(const Hdf5Process&) = delete;

  /// Throw Hdf5Failure if the program has ended or does not answer, and Interrupted.
  void send(std::string_view bytes);
  /// Puts at least one byte where it is told. Returns how many.
  std::size_t receive(std::span<char> to);

 private:
  void end();
  /// Waits until the socket can be read or written.
  void wait(short events);
  [[noreturn]] void fail_ended();

  const StopToken* stop_;
  std::int64_t seconds_;
  double waited_ = 0;  ///< For the program, in seconds.
  int socket_ = -1;
  pid_t child_ = -1;
};

}  // namespace varimesh::formats
