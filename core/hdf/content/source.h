// What readers see of an HDF5 file: groups, and arrays whose rows they read.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/formats/common/file_allowance.h"

namespace varimesh::formats {

namespace hdf5 {

/// What an array consists of.
enum class Kind : char {
  Group = 'g',
  Integers = 'i',
  Numbers = 'f',
  Texts = 's',
  Other = 'o',  ///< Anything that cannot be read: records, references, links, external and virtual arrays.
};

/// The most bytes that are read at a time.
inline constexpr std::int64_t kMostBytes = std::int64_t(1) << 22;

}  // namespace hdf5

/// A member or an attribute of a group.
struct Hdf5Item {
  hdf5::Kind kind = hdf5::Kind::Other;
  bool attribute = false;
  std::size_t width = 0;           ///< Of texts: the bytes of one.
  std::vector<std::int64_t> dims;  ///< Empty for a single value.
  std::string name;

  std::int64_t rows() const { return dims.empty() ? 1 : dims[0]; }
  /// Values in a row, at most 2^40.
  std::int64_t columns() const;
};

/// Where the content of a file comes from: HDF5 (library/file.h), or a fuzzer. Throws ReadFailure, or what HDF5
/// refuses.
class Hdf5Source {
 public:
  virtual ~Hdf5Source() = default;
  /// The members and attributes of the group with this path, such as "/" or "/Base/Zone", or the attributes of an
  /// array. Takes their memory from the allowance first.
  virtual std::vector<Hdf5Item> list(const std::string& group, FileAllowance& allowance) = 0;
  /// Reads rows of an array: integers and numbers of 8 bytes, or texts. `path`: for an attribute its owner's path, a
  /// line feed, and its name.
  /// `out` has the size of the values, at most kMostBytes.
  virtual void read(const std::string& path, hdf5::Kind kind, std::int64_t first, std::span<char> out,
                    std::int64_t count) = 0;
};

/// A group of a file, with what it contains. Throws ReadFailure, with sentences that name the array.
class Hdf5Group {
 public:
  Hdf5Group(Hdf5Source& source, FileAllowance& allowance, std::string path);

  const std::string& path() const { return path_; }
  std::span<const Hdf5Item> items() const { return items_; }
  /// Null if there is none.
  const Hdf5Item* find(std::string_view name, bool attribute = false) const;
  Hdf5Group group(std::string_view name) const;
  /// An array as a group that has only its attributes.
  Hdf5Group attributes_of(std::string_view name) const { return {*source_, *allowance_, path_of(name)}; }

  /// The one integer of an attribute.
  std::int64_t attribute(std::string_view name) const;
  /// All integers, numbers or texts of an array. Texts end before their first zero byte, and without blanks.
  std::vector<std::int64_t> integers(std::string_view name) const;
  std::vector<std::string> texts(std::string_view name, bool attribute = false) const;

  /// Calls body(first, count, values) for the rows of an array in order, half a MiB at a time. T: std::int64_t or
  /// double. The array has `columns` values in a row; 0: any number. Returns the number of rows.
  template <class T, class Body>
  std::int64_t for_rows(std::string_view name, std::int64_t columns, const Body& body) const {
    constexpr hdf5::Kind kKind = std::is_same_v<T, double> ? hdf5::Kind::Numbers : hdf5::Kind::Integers;
    const Hdf5Item& item = need(name, kKind, false);
    if (columns > 0 && item.columns() != columns)
      fail(name, "has " + std::to_string(item.columns()) + " values in a row, not " + std::to_string(columns));
    if (item.columns() == 0) return item.rows();
    const std::int64_t per_slice = slice(name, item, sizeof(T));
    std::vector<T> values;
    const std::size_t room = std::size_t(std::min(per_slice, item.rows()) * item.columns()) * sizeof(T);
    allowance_->take(room, 1);
    for (std::int64_t first = 0; first < item.rows(); first += per_slice) {
      allowance_->look_now();
      const std::int64_t count = std::min(per_slice, item.rows() - first);
      values.resize(std::size_t(count * item.columns()));
      source_->read(path_of(name), kKind, first, {reinterpret_cast<char*>(values.data()), values.size() * sizeof(T)},
                    count);
      body(first, count, static_cast<const T*>(values.data()));
    }
    allowance_->give_back(room);
    return item.rows();
  }

  /// Throws: the array has this fault. `row` counts from 0; negative: none.
  [[noreturn]] void fail(std::string_view name, const std::string& fault, std::int64_t row = -1) const;
  /// The item with this name and kind. Throws if there is none.
  const Hdf5Item& need(std::string_view name, hdf5::Kind kind, bool attribute) const;

 private:
  std::string path_of(std::string_view name, bool attribute = false) const;
  /// The rows that are read at a time.
  std::int64_t slice(std::string_view name, const Hdf5Item& item, std::size_t bytes_each) const;

  Hdf5Source* source_;
  FileAllowance* allowance_;
  std::string path_;
  std::vector<Hdf5Item> items_;
};

}  // namespace varimesh::formats
