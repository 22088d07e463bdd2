// HDF5 files, read and written by a process of its own. Internal to core/formats.
#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/aligned.h"
#include "core/base/error.h"
#include "core/base/shared_work.h"
#include "core/base/team.h"
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
  /// Rows of an array, in any order. Several threads may write rows at the same time.
  void rows(const std::string& path, std::int64_t first, std::int64_t count, std::string_view values);

  /// Ends the file and passes its bytes to the sink; one thread reads while another passes on. Errors: Output if the
  /// sink stopped.
  Expected<void> finish(const Sink& sink, const Team& team);

 private:
  std::string make(hdf5::Request request, const std::string& what, std::string_view type,
                   std::span<const std::int64_t> dims, std::string_view values);

  Scratch file_;
  const StopToken* stop_;
  std::map<std::string, std::int64_t, std::less<>> places_;  ///< The byte of the file where an array's values begin.
  std::mutex asking_;
  std::optional<Hdf5Process> process_;
};

/// How many things with so many bytes each a thread writes at a time.
constexpr std::size_t hdf5_piece(std::size_t bytes_each) {
  constexpr std::size_t kPieceBytes = std::size_t(1) << 20;  // stay in a core's cache
  return std::max<std::size_t>(1, kPieceBytes / bytes_each);
}

/// Writes the rows of an array that belong to `count` things, such as cells, `rows_each` rows each, from row `first`
/// on. fill(begin, end, values) makes the values of the things from begin to end − 1; the threads of the team call it
/// for pieces that are multiples of hdf5_piece(). Call it inside team.run().
template <class T, class Fill>
void write_hdf5_rows(Hdf5Writer& writer, const std::string& path, std::int64_t first, std::size_t count,
                     std::size_t rows_each, std::size_t columns, const Team& team, const Fill& fill) {
  const std::size_t each = rows_each * columns;
  for_chunks(team, count, hdf5_piece(each * sizeof(T)), [&](std::size_t, std::size_t begin, std::size_t end) {
    UntouchedVector<T> values((end - begin) * each);
    fill(begin, end, values.data());
    writer.rows(path, first + std::int64_t(begin * rows_each), std::int64_t((end - begin) * rows_each),
                {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)});
  });
}

/// Values as bytes.
template <class T>
std::string_view bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

/// What body() returns, or the Error for what HDF5 refused.
Expected<void> written_hdf5(const std::function<Expected<void>()>& body);

}  // namespace varimesh::formats
