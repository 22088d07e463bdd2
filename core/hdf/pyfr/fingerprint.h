// A number of the content of a mesh. Internal to core/formats.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

namespace varimesh::formats {

/// A number of the content, by which PyFR knows to which mesh a solution belongs: FNV-1a with 128 bits (Fowler, Noll,
/// Vo), of 8 bytes at a time and with the multiplier of the 128-bit generator of PCG (O'Neill), whose bits are spread.
class Fingerprint {
 public:
  void update(std::string_view bytes) {
    std::uint64_t word = 0;
    for (; bytes.size() >= sizeof word; bytes.remove_prefix(sizeof word)) {
      std::memcpy(&word, bytes.data(), sizeof word);
      add(word);
    }
    word = 0;
    std::memcpy(&word, bytes.data(), bytes.size());
    add(word);
  }
  void update(const Fingerprint& part) {
    add(std::uint64_t(part.hash_));
    add(std::uint64_t(part.hash_ >> 64));
  }
  /// As a UUID: 8-4-4-4-12 hexadecimal digits.
  std::string uuid() const {
    std::string text;
    for (int digit = 31; digit >= 0; --digit) {
      if (digit == 23 || digit == 19 || digit == 15 || digit == 11) text += '-';
      text += "0123456789abcdef"[unsigned(hash_ >> (4 * digit)) & 15U];
    }
    return text;
  }

 private:
  using Wide = unsigned __int128;
  static constexpr Wide kMultiplier = (Wide(0x2360ed051fc65da4) << 64) + 0x4385df649fccf645;
  void add(std::uint64_t word) { hash_ = (hash_ ^ word) * kMultiplier; }
  Wide hash_ = (Wide(0x6c62272e07bb0142) << 64) + 0x62b821756295c58d;
};

}  // namespace varimesh::formats
