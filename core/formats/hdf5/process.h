// Starts varimesh_hdf5, the program that reads and writes HDF5 files, and asks it. Internal to core/formats.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "core/base/stop_token.h"
#include "core/formats/hdf5/protocol.h"

namespace varimesh::formats {

/// What went wrong, as a part of a sentence without its end.
struct Hdf5Failure {
  std::string reason;
  bool missing = false;  ///< The program is not installed.
};

/// An open file without a name, which is gone when this object is: in the folder for temporary files, or in memory if
/// this folder takes none.
class Scratch {
 public:
  Scratch();
  ~Scratch();
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  int descriptor() const { return descriptor_; }

 private:
  int descriptor_;
};

/// Where the program is: VARIMESH_HDF5, beside this program, or in the folder lib/varimesh beside this program's
/// folder. Empty if it is not installed.
std::string hdf5_program();

/// The program, which runs while this object lives. Its limits: one minute and one second per 10 MB of processor time,
/// 512 MiB and the size of the file of memory.
class Hdf5Process {
 public:
  /// Reads the HDF5 file that these bytes are. It refers to them, and gives the program only those that HDF5 asks for.
  /// @param stop may be null; if it asks to stop, ask() throws Interrupted
  /// Throws Hdf5Failure.
  Hdf5Process(std::string_view file, const StopToken* stop);
  /// Writes an HDF5 file.
  /// @param file_bytes about the size that it will have
  Hdf5Process(const Scratch& file, std::int64_t file_bytes, const StopToken* stop);
  ~Hdf5Process();
  Hdf5Process(const Hdf5Process&) = delete;
  Hdf5Process& operator=(const Hdf5Process&) = delete;

  /// Sends a request and returns the answer. `before` is called with its size before it takes memory. Throws
  /// Hdf5Failure.
  std::string ask(
      hdf5::Request request, std::string_view text, std::string_view values = {}, std::int64_t first = 0,
      std::int64_t count = 0, const std::function<void(std::int64_t bytes)>& before = [](std::int64_t) {});
  /// The same for an answer of exactly the size of `out`.
  void ask(hdf5::Request request, std::string_view text, std::int64_t first, std::int64_t count, std::span<char> out);

 private:
  void start(bool writes, const Scratch& file, std::int64_t file_bytes);
  /// The program's first answer: whether it could open the file.
  void open();
  void end();
  void send(std::string_view bytes);
  void receive(char* to, std::size_t bytes);
  /// Waits until the socket can be read or written.
  void wait(short events);
  /// The size of the answer that follows, for which the program gets the bytes of the file that it needs. Throws if the
  /// request failed.
  std::int64_t answer(std::int64_t most);
  [[noreturn]] void fail_ended();

  std::string_view file_;  ///< That is read.
  const StopToken* stop_;
  std::int64_t seconds_ = 0;
  int socket_ = -1;
  pid_t child_ = -1;
};

}  // namespace varimesh::formats
