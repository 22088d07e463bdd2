// What is sent to a server or read for the command: files, pipes and devices alike.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

namespace varimesh::client {

struct Failure;

/// Bytes that can be read from any offset and as often as needed. What can be read only once, a pipe or a device, goes
/// through a temporary file without a name, which is gone with the process however it ends.
class InputFile {
 public:
  /// Opens `path` and, where it is a pipe or a device, reads it to its end; `interrupted` is asked while it waits.
  /// Failures: File, Interrupted.
  static tl::expected<InputFile, Failure> open(const std::string& path, const std::function<bool()>& interrupted = {});
  /// An empty one, for append(); errors call it `name`.
  static tl::expected<InputFile, Failure> temporary(const std::string& name);

  InputFile(InputFile&& other) noexcept;
  InputFile& operator=(InputFile&&) = delete;
  ~InputFile();

  /// Reads up to `most` bytes from `offset` on; fewer, or none, only at the end. Failures: File.
  tl::expected<std::string, Failure> read(std::int64_t offset, std::size_t most) const;
  /// To a temporary one alone: false where the bytes cannot be written (errno).
  bool append(std::string_view bytes);

 private:
  InputFile(std::string name, int descriptor) : name_(std::move(name)), descriptor_(descriptor) {}

  std::string name_;
  int descriptor_;
};

/// The whole of a small file. Failures: File, Interrupted.
tl::expected<std::string, Failure> read_whole(const std::string& path, const std::function<bool()>& interrupted = {});

}  // namespace varimesh::client
