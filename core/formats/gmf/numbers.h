// The numbers of a GMF file. Internal to core/formats.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "core/base/io/scanner.h"

namespace varimesh::formats::gmf {

/// How many integers and reals a thing of a section has, such as a vertex.
struct Thing {
  std::int64_t integers, reals;
};

/// The numbers of a file, as text or binary of either byte order.
class Numbers {
 public:
  /// Whether a file begins as a binary one does.
  static bool is_binary(std::string_view bytes) {
    std::array<std::int32_t, 2> first{};
    if (bytes.size() < sizeof first) return false;
    std::memcpy(first.data(), bytes.data(), sizeof first);
    constexpr std::int32_t kSwapped = 1 << 24;
    const bool own = first[0] == 1 && first[1] >= 1 && first[1] <= 4;
    return own ||
           (first[0] == kSwapped && first[1] % kSwapped == 0 && first[1] >= kSwapped && first[1] <= 4 * kSwapped);
  }

  explicit Numbers(std::string_view bytes) : scan(bytes), binary_(is_binary(bytes)) {
    if (!binary_) return;
    std::int32_t first = 0;
    std::memcpy(&first, bytes.data(), sizeof first);
    swapped_ = first != 1;
    (void)raw<std::int32_t>("the byte order");
    version = raw<std::int32_t>("the version");
  }

  Scanner scan;
  std::int64_t version = 1;
  bool is_binary_file() const { return binary_; }

  std::int64_t keyword() { return raw<std::int32_t>("a keyword"); }
  std::int64_t position() { return version < 3 ? raw<std::int32_t>("a position") : raw<std::int64_t>("a position"); }
  std::int64_t small(const char* what) { return binary_ ? raw<std::int32_t>(what) : scan.text_integer(what); }
  std::int64_t integer(const char* what) {
    if (!binary_) return scan.text_integer(what);
    return version < 4 ? raw<std::int32_t>(what) : raw<std::int64_t>(what);
  }
  double real(const char* what) {
    if (!binary_) return scan.text_number(what);
    return version == 1 ? double(raw<float>(what)) : raw<double>(what);
  }
  /// How many bytes a value takes in the file. In text this is the least number of bytes.
  std::size_t bytes(const Thing& thing) const {
    const auto [integers, reals] = thing;
    return std::size_t(binary_ ? integers * (version < 4 ? 4 : 8) + reals * (version == 1 ? 4 : 8)
                               : 2 * (integers + reals));
  }
  /// Reads a count of things, and checks that the file has room for them.
  std::int64_t count(const char* what, const Thing& thing) {
    const std::int64_t n = integer(what), each = std::int64_t(bytes(thing));
    if (n < 0 || n > std::int64_t(scan.left()) / each + 1)
      scan.fail_truncated(("everything that " + std::string(what) + ", " + std::to_string(n) + ", announces").c_str());
    return n;
  }

 private:
  template <class T>
  T raw(const char* what) {
    if (scan.left() < sizeof(T)) scan.fail_truncated(what);
    std::array<char, sizeof(T)> bytes;
    std::memcpy(bytes.data(), scan.rest().data(), sizeof(T));
    if (swapped_) std::reverse(bytes.begin(), bytes.end());
    scan.go_to(scan.offset() + sizeof(T));
    return std::bit_cast<T>(bytes);
  }

  bool binary_;
  bool swapped_ = false;
};

}  // namespace varimesh::formats::gmf
