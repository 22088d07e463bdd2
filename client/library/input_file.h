// Input files for the library and the command. A pipe or a device is read like a file.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
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

  /// The same file once more. Failures: File.
  tl::expected<InputFile, Failure> again() const;

  /// Reads `most` bytes from `offset` on. Only at the end of the file it returns fewer, or none. Failures: File.
  tl::expected<std::string, Failure> read(std::int64_t offset, std::size_t most) const;
  /// The same into `bytes`, whose memory is used again. Failures: File.
  tl::expected<void, Failure> read(std::int64_t offset, std::size_t most, std::string& bytes) const;
  /// Reads all bytes. Failures: File.
  tl::expected<std::string, Failure> read_all() const;
  /// Whether somebody has written to a file since it was opened. Never true of a temporary file.
  bool has_changed() const;
  /// Adds bytes to a temporary file. Returns false, with errno set, if they cannot be written.
  bool append(std::string_view bytes);

 private:
  /// What the system notes of the bytes of a file.
  struct Version {
    std::int64_t size = 0, seconds = 0, nanoseconds = 0;
    friend bool operator==(const Version&, const Version&) = default;
  };
  InputFile(std::string name, int descriptor) : name_(std::move(name)), descriptor_(descriptor) {}
  std::optional<Version> version() const;

  std::string name_;
  int descriptor_;
  std::optional<Version> opened_;  ///< When it was opened; nothing for a temporary file.
};

/// Keeps files for a server in the same process, so that they need not go through calls. There, a short file stands for
/// each: its digest is what jobs and results name. Thread-safe.
class MeshExchange {
 public:
  virtual ~MeshExchange() = default;
  /// Keeps an open file, and returns the short one that stands for it. Failures: File.
  virtual tl::expected<InputFile, Failure> keep(const InputFile& file) = 0;
  /// The file that the short one with this digest stands for; null if there is none.
  virtual std::shared_ptr<const InputFile> find(const std::string& digest) const = 0;
};

/// Reads the whole of a small file. Failures: File, Interrupted.
tl::expected<std::string, Failure> read_whole(const std::string& path, const std::function<bool()>& interrupted = {});

}  // namespace varimesh::client
