// An allowance that refuses the file itself, for readers of XML and ISM. Internal to core/formats. The readers of
// records of text ask their Scanner, which names the place in the file.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/base/io/allowance.h"
#include "core/base/io/scanner.h"

namespace varimesh::formats {

/// The most memory that reading a file of this size takes with these readers, in bytes.
constexpr std::int64_t most_file_memory(std::int64_t file_bytes) { return 8 * file_bytes + (std::int64_t{64} << 20); }

/// Counts what a reader takes, and throws ReadFailure if a file asks for more than most_file_memory(). A damaged
/// or hostile file does so, and a compressed file that consists of zeros.
class FileAllowance {
 public:
  /// `stop` may be null.
  explicit FileAllowance(std::size_t file_bytes, const StopToken* stop = nullptr)
      : allowance_(most_file_memory(std::int64_t(file_bytes)), stop, WithheldMemory::current()) {}

  /// Must come before the memory is taken. Throws Interrupted if reading is to stop.
  void take(std::size_t count, std::size_t bytes_each) {
    look();
    constexpr std::size_t kMost = std::numeric_limits<std::int64_t>::max() / 2;
    if (bytes_each == 0) return;
    if (count > kMost / bytes_each || !allowance_.take(count * bytes_each))
      throw ReadFailure{
          "The mesh file cannot be read: what it describes takes more than 8 times the memory of the file and 64 MiB. "
          "The file is damaged, or it leaves almost everything out; write it in another format, for example MSH."};
  }
  /// What was taken and is free again.
  void give_back(std::size_t bytes) { allowance_.give_back(bytes); }
  /// Makes room for `more` elements: for at least half more than there is, so that a list that grows is seldom copied.
  template <class T>
  void make_room(std::vector<T>& values, std::size_t more) {
    const std::size_t before = values.capacity(), size = values.size() + more;
    if (size <= before) return;
    const std::size_t room = std::max(size, before + before / 2);
    take(room, sizeof(T));
    reserve_large(values, room);
    give_back(before * sizeof(T));
  }
  /// Called for every record.
  void look() { allowance_.look(); }
  /// Called for every piece of many records.
  void look_now() const { allowance_.look_now(); }
  /// For a Scanner that is to count with it.
  Allowance* counted() { return &allowance_; }

 private:
  Allowance allowance_;
};

}  // namespace varimesh::formats
