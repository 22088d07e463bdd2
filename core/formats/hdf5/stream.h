// Bytes between the library and the program for HDF5 files, with a buffer for small values. Internal to
// core/formats/hdf5 and core/hdf.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <functional>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace varimesh::formats::hdf5 {

inline constexpr std::size_t kBuffered = std::size_t(1) << 16;

/// Passes bytes on to `all`, which takes all that it gets.
class Outgoing {
 public:
  explicit Outgoing(std::function<void(std::string_view)> all) : all_(std::move(all)) { buffer_.reserve(kBuffered); }

  void put(std::string_view bytes) {
    if (buffer_.size() + bytes.size() > kBuffered) flush();
    if (bytes.size() > kBuffered) return all_(bytes);
    buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  }
  template <class T>
  void value(const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    put({reinterpret_cast<const char*>(&value), sizeof value});
  }
  void flush() {
    if (!buffer_.empty()) all_({buffer_.data(), buffer_.size()});
    buffer_.clear();
  }

 private:
  std::function<void(std::string_view)> all_;
  std::vector<char> buffer_;
};

/// Takes bytes from `some`, which puts at least one where it is told and returns how many.
class Incoming {
 public:
  explicit Incoming(std::function<std::size_t(std::span<char>)> some) : some_(std::move(some)), buffer_(kBuffered) {}

  void get(std::span<char> to) {
    while (!to.empty()) {
      if (begin_ == end_ && to.size() < kBuffered) {
        begin_ = 0;
        end_ = some_(buffer_);
      }
      const std::size_t here = std::min(to.size(), end_ - begin_);
      std::memcpy(to.data(), buffer_.data() + begin_, here);
      begin_ += here;
      to = to.subspan(here);
      if (begin_ == end_ && to.size() >= kBuffered) to = to.subspan(some_(to));
    }
  }
  template <class T>
  T value() {
    static_assert(std::is_trivially_copyable_v<T>);
    T value{};
    get({reinterpret_cast<char*>(&value), sizeof value});
    return value;
  }

 private:
  std::function<std::size_t(std::span<char>)> some_;
  std::vector<char> buffer_;
  std::size_t begin_ = 0, end_ = 0;
};

}  // namespace varimesh::formats::hdf5
