// Output files: whole or not at all under their name.
#pragma once

#include <sys/types.h>

#include <string>
#include <string_view>

#include "core/base/error.h"

namespace varimesh::formats {

/// A file that is written beside its place and takes it over once it is whole; without commit() it leaves no trace.
/// Links are followed: what they lead to is replaced, with its rights kept, or
/// written over where something is mounted on the name, which cannot be replaced. A device, a named pipe and a
/// descriptor of this process (/dev/stdout) cannot be replaced: the bytes go there as they come.
class OutputFile {
 public:
  /// Errors: Output, for a folder, a missing one, a file that is write-protected.
  static Expected<OutputFile> open(const std::string& path);
  /// Whether open() and a write could succeed, found out without touching what is there.
  static Expected<void> check(const std::string& path);

  OutputFile(OutputFile&& other) noexcept;
  OutputFile& operator=(OutputFile&&) = delete;
  ~OutputFile();

  /// False where not all could be written; commit() will say why.
  bool write(std::string_view bytes);
  bool failed() const { return error_ != 0; }
  /// Puts the bytes on the disk and the file in its place. Errors: Output, also for what write() met.
  Expected<void> commit();

  /// Removes what unfinished files of this process have written and lets no more be opened or committed: for a process
  /// about to end at once.
  static void discard_all();

 private:
  OutputFile(std::string path, std::string target, std::string beside, int descriptor)
      : path_(std::move(path)), target_(std::move(target)), beside_(std::move(beside)), descriptor_(descriptor) {}

  std::string path_;    ///< As it was named.
  std::string target_;  ///< What it leads to.
  std::string beside_;  ///< Empty: written directly.
  int descriptor_ = -1;
  int error_ = 0;  ///< errno of the write that failed first.
};

}  // namespace varimesh::formats
