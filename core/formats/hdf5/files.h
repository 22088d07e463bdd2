// HDF5 files, read and written by a process of its own. Internal to core/formats.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "core/formats/formats.h"
#include "core/formats/hdf5/process.h"
#include "core/formats/hdf5/source.h"

namespace varimesh::formats {

/// Whether the bytes begin like an HDF5 file.
bool begins_like_hdf5(std::string_view bytes);

/// The file that these bytes are. Throws ReadFailure if HDF5 cannot open it, and Interrupted.
std::unique_ptr<Hdf5Source> open_hdf5(std::string_view bytes, const StopToken* stop);

/// Writes a file. Every function throws Hdf5Failure; written() turns what is thrown into an Error.
class Hdf5Writer {
 public:
  /// @param file_bytes about the size that the file will have
  explicit Hdf5Writer(std::int64_t file_bytes, const StopToken* stop);

  void group(const std::string& path);
  /// An array or an attribute with its values. `type`: as in protocol.h; `dims` empty: a single value.
  void array(const std::string& path, std::string_view type, std::span<const std::int64_t> dims,
             std::string_view values);
  void attribute(const std::string& owner, const std::string& name, std::string_view type,
                 std::span<const std::int64_t> dims, std::string_view values);
  /// An array whose rows follow, with rows().
  void array(const std::string& path, std::string_view type, std::span<const std::int64_t> dims);
  void rows(const std::string& path, std::int64_t first, std::int64_t count, std::string_view values);

  /// Ends the file and passes its bytes to the sink. Errors: Output if the sink stopped.
  Expected<void> finish(const Sink& sink);

 private:
  void make(hdf5::Request request, const std::string& what, std::string_view type, std::span<const std::int64_t> dims,
            std::string_view values);

  Scratch file_;
  const StopToken* stop_;
  std::optional<Hdf5Process> process_;
};

/// The rows of an array, collected and written some MiB at a time.
template <class T>
class Hdf5Rows {
 public:
  Hdf5Rows(Hdf5Writer& writer, std::string path, std::size_t columns)
      : writer_(writer), path_(std::move(path)), columns_(columns) {
    values_.reserve(std::size_t(hdf5::kMostBytes) / sizeof(T) / columns * columns);
  }
  /// Adds a value; a row is complete after `columns` of them.
  void add(T value) {
    values_.push_back(value);
    if (values_.size() == values_.capacity()) flush();
  }
  /// Writes the rows that remain.
  void flush() {
    const auto count = std::int64_t(values_.size() / columns_);
    if (count > 0)
      writer_.rows(path_, next_, count, {reinterpret_cast<const char*>(values_.data()), values_.size() * sizeof(T)});
    next_ += count;
    values_.clear();
  }

 private:
  Hdf5Writer& writer_;
  std::string path_;
  std::size_t columns_;
  std::int64_t next_ = 0;
  std::vector<T> values_;
};

/// Values as bytes.
template <class T>
std::string_view bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

/// What body() returns, or the Error for what HDF5 refused.
Expected<void> written_hdf5(const std::function<Expected<void>()>& body);

}  // namespace varimesh::formats
