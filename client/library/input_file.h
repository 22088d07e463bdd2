// Input files for the library and the command. A pipe or a device is read like a file.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

namespace varimesh::client {

struct Failure;

/// Bytes that can be read from any offset, any number of times. A pipe or a device, which can be read only once, is
/// copied to a temporary file that has no name and so disappears with the process, however the process ends.
class InputFile {
 public:
  /// Opens `path`. A pipe or a device is read to its end; meanwhile `interrupted` is called every 100 ms.
  /// Failures: File, Interrupted.
  static tl::expected<InputFile, Failure> open(const std::string& path, const std::function<bool()>& interrupted = {});
  /// An empty temporary file for append(). Error messages call it `name`.
  static tl::expected<InputFile, Failure> temporary(const std::string& name);

  InputFile(InputFile&& other) noexcept;
  InputFile& operator=(InputFile&&) = delete;
  ~InputFile();

  /// Reads `most` bytes from `offset` on. Only at the end of the file it returns fewer, or none. Failures: File.
  tl::expected<std::string, Failure> read(std::int64_t offset, std::size_t most) const;
  /// Adds bytes to a temporary file. Returns false, with errno set, if they cannot be written.
  bool append(std::string_view bytes);

 private:
  InputFile(std::string name, int descriptor) : name_(std::move(name)), descriptor_(descriptor) {}

  std::string name_;
  int descriptor_;
};

/// Reads the whole of a small file. Failures: File, Interrupted.
tl::expected<std::string, Failure> read_whole(const std::string& path, const std::function<bool()>& interrupted = {});

}  // namespace varimesh::client
