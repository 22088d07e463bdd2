#include "core/formats/vtu/stored_stream.h"

#include <algorithm>
#include <array>
#include <cstring>

namespace varimesh::formats {

namespace {

constexpr std::uint32_t kModulus = 65521;

}  // namespace

// The bytes are rows of kLanes columns. `sum` has the sums of the columns and `before` the sums of `sum` before each
// row, so a byte counts in `before` once for each row after its own.
std::uint32_t adler32_of(std::string_view bytes) {
  constexpr std::size_t kLanes = 16, kMostRows = 4096;  // of 255 in every row, `before` adds up to less than 2³²
  std::uint64_t low = 1, high = 0;
  while (bytes.size() >= kLanes) {
    const std::size_t rows = std::min(kMostRows, bytes.size() / kLanes);
    std::array<std::uint32_t, kLanes> sum{}, before{};
    const auto* row = reinterpret_cast<const unsigned char*>(bytes.data());
    for (std::size_t r = 0; r < rows; ++r, row += kLanes)
      for (std::size_t k = 0; k < kLanes; ++k) {
        before[k] += sum[k];
        sum[k] += row[k];
      }
    high += rows * kLanes * low;
    for (std::size_t k = 0; k < kLanes; ++k) {
      high += kLanes * std::uint64_t(before[k]) + (kLanes - k) * std::uint64_t(sum[k]);
      low += sum[k];
    }
    low %= kModulus;
    high %= kModulus;
    bytes.remove_prefix(rows * kLanes);
  }
  for (const char c : bytes) {
    low += static_cast<unsigned char>(c);
    high += low;
  }
  return std::uint32_t(high % kModulus) << 16 | std::uint32_t(low % kModulus);
}

void write_stored_stream(std::string_view content, const std::function<void(std::string_view)>& pass_on) {
  const std::uint32_t sum = adler32_of(content);
  pass_on(std::string_view("\x78\x01", 2));
  while (!content.empty()) {
    const std::string_view part = content.substr(0, kMostStored);
    content.remove_prefix(part.size());
    const auto low = char(part.size() & 255), high = char(part.size() >> 8);
    const char head[] = {char(content.empty() ? 1 : 0), low, high, char(~low), char(~high)};
    pass_on({head, sizeof head});
    pass_on(part);
  }
  const char tail[] = {char(sum >> 24), char(sum >> 16), char(sum >> 8), char(sum)};
  pass_on({tail, sizeof tail});
}

bool read_stored_stream(std::string_view stream, std::span<char> content) {
  const auto at = [&](std::size_t i) { return std::uint32_t(static_cast<unsigned char>(stream[i])); };
  // Deflate with a window of at most 32 KiB, without a dictionary.
  if (stream.size() < 2 || (at(0) & 15) != 8 || at(0) >> 4 > 7 || (at(0) << 8 | at(1)) % 31 != 0 || (at(1) & 32) != 0)
    return false;
  stream.remove_prefix(2);
  std::size_t filled = 0;
  for (bool last = false; !last;) {
    if (stream.size() < 5 || at(0) > 1) return false;
    last = at(0) == 1;
    const std::uint32_t size = at(1) | at(2) << 8, complement = at(3) | at(4) << 8;
    if (size != (~complement & 0xffff) || size > stream.size() - 5 || size > content.size() - filled) return false;
    std::memcpy(content.data() + filled, stream.data() + 5, size);
    filled += size;
    stream.remove_prefix(5 + size);
  }
  if (filled != content.size() || stream.size() < 4) return false;
  return (at(0) << 24 | at(1) << 16 | at(2) << 8 | at(3)) == adler32_of({content.data(), content.size()});
}

}  // namespace varimesh::formats
