// Output files that appear under their name only when they are complete.
#pragma once

#include <sys/types.h>

#include <string>
#include <string_view>

#include "core/base/error.h"

namespace varimesh {

/// A file that is written under a temporary name in the same folder. commit() gives it its name and replaces an
/// existing file, whose permissions it keeps. Without commit() nothing remains of it.
///
/// Links are followed, and the file that they lead to is replaced. If something is mounted on the name, the file cannot
/// be replaced and is overwritten. A device, a named pipe or a descriptor of this process (/dev/stdout) cannot be
/// replaced either, so the bytes are written to it directly.
class OutputFile {
 public:
  /// Errors: Output, if the path is a folder, its folder does not exist, or the file is write-protected.
  static Expected<OutputFile> open(const std::string& path);
  /// Checks whether open() and a write could succeed, without changing an existing file. Errors as for open().
  static Expected<void> check(const std::string& path);

  OutputFile(OutputFile&& other) noexcept;
  OutputFile& operator=(OutputFile&&) = delete;
  ~OutputFile();

  /// Returns false if not all bytes could be written; commit() returns the reason.
  bool write(std::string_view bytes);
  bool failed() const { return error_ != 0; }
  /// Brings the bytes to the disk and gives the file its name. Errors: Output, also if a write() failed before.
  Expected<void> commit();

  /// Removes all unfinished files of this process, and blocks every later open() and commit(). For a process that is
  /// about to exit.
  static void discard_all();

 private:
  OutputFile(std::string path, std::string target, std::string beside, int descriptor)
      : path_(std::move(path)), target_(std::move(target)), beside_(std::move(beside)), descriptor_(descriptor) {}

  std::string path_;    ///< The name as given.
  std::string target_;  ///< The file to which the name leads.
  std::string beside_;  ///< The temporary name; empty if the bytes are written directly.
  int descriptor_ = -1;
  int error_ = 0;  ///< errno of the first write that failed.
};

}  // namespace varimesh
