// The arrays of a VTU file that is written: appended raw data in zlib streams. Internal to core/formats.
// Format: "VTK XML Formats" in the VTK documentation. An array begins with a header of UInt64: the number of blocks,
// the bytes per block, the bytes of the last block if it is shorter, and the compressed bytes of each block.
#pragma once

#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "core/base/aligned.h"
#include "core/base/io/buffered_output.h"
#include "core/base/team.h"
#include "core/formats/vtu/stored_stream.h"

namespace varimesh::formats {

/// Bytes of a block, a multiple of the size of every type.
inline constexpr std::size_t kVtkBlock = std::size_t(1) << 18;

/// What an array is called in the file.
struct VtkName {
  std::string name;
  std::string type;
  int components = 1;
};

/// How many bytes an array with `bytes` bytes needs so that it has `remainder` bytes more than a multiple of 4. They
/// follow the end of the last zlib stream, where nobody looks for data.
constexpr std::size_t vtk_padding(std::size_t bytes, std::size_t remainder) { return (4 + remainder - bytes % 4) % 4; }

/// An array of numbers that compress well. Its compressed blocks stay in memory until the file has its header.
class CompressedArray {
 public:
  CompressedArray(const Team& team, VtkName name) : name(std::move(name)), team_(team) {}

  VtkName name;

  template <class T>
  void put(T value) {
    if (used_ + sizeof(T) > block_.size()) make_room(sizeof(T));
    std::memcpy(block_.data() + used_, &value, sizeof(T));
    used_ += sizeof(T);
    ++count_;
  }
  std::size_t count() const { return count_; }

  void finish() {
    last_ = used_;
    if (used_ > 0) end_block();
    compress();
    std::vector<char>().swap(block_);  // assigning {} would keep its memory
  }

  void pad(std::size_t remainder) {
    if (sizes_.empty()) return;
    const std::size_t added = vtk_padding(bytes(), remainder);
    data_.append(added, '\0');
    sizes_.back() += added;
  }

  std::size_t bytes() const { return 8 * (3 + sizes_.size()) + data_.size(); }

  void write(BufferedOutput& out) const {
    const std::uint64_t partial = last_ == kVtkBlock ? 0 : last_;
    std::vector<std::uint64_t> header{sizes_.size(), kVtkBlock, partial};
    header.insert(header.end(), sizes_.begin(), sizes_.end());
    out.text({reinterpret_cast<const char*>(header.data()), 8 * header.size()});
    out.text(data_);
  }

 private:
  static constexpr std::size_t kBlocksPerThread = 4;  // that wait to be compressed at the same time

  void make_room(std::size_t bytes) {
    if (used_ + bytes > kVtkBlock) end_block();
    // A mesh may have a hundred thousand arrays of a few bytes: one for each named group.
    constexpr std::size_t kFirst = 64;
    const bool is_long = block_.empty() && (!waiting_.empty() || !sizes_.empty());
    block_.resize(is_long ? kVtkBlock : std::min(kVtkBlock, std::max(kFirst, 2 * block_.size())));
  }

  void end_block() {
    block_.resize(used_);
    waiting_.push_back(std::exchange(block_, {}));
    used_ = 0;
    if (waiting_.size() >= kBlocksPerThread * std::size_t(team_.threads())) compress();
  }

  void compress() {
    std::vector<std::string> compressed(waiting_.size());
    team_.for_each(std::int32_t(waiting_.size()), 1, [&](std::int32_t i) {
      const std::vector<char>& block = waiting_[std::size_t(i)];
      std::string& bytes = compressed[std::size_t(i)];
      uLongf size = compressBound(uLong(block.size()));
      bytes.resize(size);
      compress2(reinterpret_cast<Bytef*>(bytes.data()), &size, reinterpret_cast<const Bytef*>(block.data()),
                uLong(block.size()), 1);
      bytes.resize(size);
    });
    for (const std::string& bytes : compressed) {
      data_ += bytes;
      sizes_.push_back(bytes.size());
    }
    waiting_.clear();
  }

  const Team& team_;
  std::vector<char> block_;
  std::size_t used_ = 0, last_ = 0, count_ = 0;
  std::vector<std::vector<char>> waiting_;
  std::string data_;
  std::vector<std::uint64_t> sizes_;
};

/// An array of numbers that hardly compress, or that are many: zlib streams whose content is stored as it is. Their
/// sizes are known before the numbers are, so nothing of it stays in memory. Level 1 of zlib takes twenty times as long
/// and saves 5 per cent of coordinates.
class StoredArray {
 public:
  StoredArray(VtkName name, std::size_t content) : name(std::move(name)), content_(content) {}

  VtkName name;

  void pad(std::size_t remainder) {
    if (content_ > 0) padding_ = vtk_padding(bytes(), remainder);
  }
  std::size_t bytes() const {
    std::size_t sum = 8 * (3 + blocks()) + padding_;
    for (std::size_t block = 0; block < blocks(); ++block) sum += stored_stream_size(size_of(block));
    return sum;
  }

  /// Writes the array. fill(put) calls put(value) for each of its numbers.
  template <class Fill>
  void write(BufferedOutput& out, const Fill& fill) const {
    write_header(out);
    std::vector<char> block(kVtkBlock);
    std::size_t used = 0;
    const auto put = [&](auto value) {
      std::memcpy(block.data() + used, &value, sizeof value);
      used += sizeof value;
      if (used == kVtkBlock) write_stream({block.data(), std::exchange(used, 0)}, out);
    };
    fill(put);
    if (used > 0) write_stream({block.data(), used}, out);
    out.text(std::string(padding_, '\0'));
  }

  /// The same for numbers that can be made in any order: fill(begin, end, to) puts the bytes of the array from `begin`
  /// to `end - 1` where `to` is. Both are multiples of the size of a number. The threads share the work.
  template <class Fill>
  void write_shared(BufferedOutput& out, const Fill& fill) const {
    write_header(out);
    out.shared(
        blocks(), 1,
        [&](BufferedOutput& piece, std::size_t begin, std::size_t end) {
          UntouchedVector<char> content(size_of(begin));
          for (std::size_t block = begin; block < end; ++block) {
            const std::size_t size = size_of(block);
            fill(block * kVtkBlock, block * kVtkBlock + size, content.data());
            write_stream({content.data(), size}, piece);
          }
        },
        stored_stream_size(kVtkBlock));
    out.text(std::string(padding_, '\0'));
  }

 private:
  std::size_t blocks() const { return (content_ + kVtkBlock - 1) / kVtkBlock; }
  std::size_t size_of(std::size_t block) const { return std::min(kVtkBlock, content_ - block * kVtkBlock); }

  void write_header(BufferedOutput& out) const {
    std::vector<std::uint64_t> header{blocks(), kVtkBlock, content_ % kVtkBlock};
    for (std::size_t block = 0; block < blocks(); ++block) header.push_back(stored_stream_size(size_of(block)));
    if (content_ > 0) header.back() += padding_;
    out.text({reinterpret_cast<const char*>(header.data()), 8 * header.size()});
  }

  static void write_stream(std::string_view content, BufferedOutput& out) {
    write_stored_stream(content, [&](std::string_view piece) { out.text(piece); });
  }

  std::size_t content_, padding_ = 0;
};

}  // namespace varimesh::formats
