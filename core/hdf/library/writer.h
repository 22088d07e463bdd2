// Writes HDF5 files.
#pragma once

#include <hdf5.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/aligned.h"
#include "core/base/shared_work.h"
#include "core/base/team.h"
#include "core/formats/hdf5/stream.h"

namespace varimesh::hdf {

/// A new file without a name, in the folder for temporary files, or in memory if this folder takes none. Its groups
/// keep the order in which their members were made, as CGNS needs it. Every function throws Refusal.
class Writer {
 public:
  Writer();
  ~Writer();
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  void group(const std::string& path);
  /// An array or an attribute with its values. `type`: of type_of(); `dims` empty: a single value.
  void array(const std::string& path, std::string_view type, std::span<const std::int64_t> dims,
             std::string_view values);
  void attribute(const std::string& owner, const std::string& name, std::string_view type,
                 std::span<const std::int64_t> dims, std::string_view values);
  /// An array whose rows follow, with rows().
  void array(const std::string& path, std::string_view type, std::span<const std::int64_t> dims);
  /// Rows of an array, in any order. Several threads may write rows at the same time.
  void rows(const std::string& path, std::int64_t first, std::int64_t count, std::string_view values);

  /// Ends the file. Returns its size.
  std::int64_t finish();
  /// Passes on the bytes of the file, once it is ended.
  void send(std::int64_t size, formats::hdf5::Outgoing& to) const;

 private:
  int descriptor_ = -1;
  hid_t file_ = -1;
  std::map<std::string, std::int64_t, std::less<>> places_;  ///< The byte of the file where an array's values begin.
};

/// How many things with so many bytes each a thread writes at a time.
constexpr std::size_t piece_of(std::size_t bytes_each) {
  constexpr std::size_t kPieceBytes = std::size_t(1) << 20;  // stay in a core's cache
  return std::max<std::size_t>(1, kPieceBytes / bytes_each);
}

/// Writes the rows of an array that belong to `count` things, such as cells, `rows_each` rows each, from row `first`
/// on. fill(begin, end, values) makes the values of the things from begin to end − 1; the threads of the team call it
/// for pieces that are multiples of piece_of(). Call it inside team.run().
template <class T, class Fill>
void write_rows(Writer& writer, const std::string& path, std::int64_t first, std::size_t count, std::size_t rows_each,
                std::size_t columns, const Team& team, const Fill& fill) {
  const std::size_t each = rows_each * columns;
  for_chunks(team, count, piece_of(each * sizeof(T)), [&](std::size_t, std::size_t begin, std::size_t end) {
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

}  // namespace varimesh::hdf
