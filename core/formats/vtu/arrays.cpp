#include "core/formats/vtu/arrays.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <type_traits>
#include <utility>

#include "core/base/aligned.h"
#include "core/base/io/scanner.h"
#include "core/base/shared_work.h"
#include "core/formats/vtu/stored_stream.h"
#include "core/formats/xml/encoding.h"

namespace varimesh::formats {

namespace {

/// The bytes of a value of this type; 0 if the type is unknown.
std::size_t size_of(std::string_view type) {
  constexpr std::array<std::pair<std::string_view, std::size_t>, 10> kSizes = {{{"Float64", 8},
                                                                                {"Float32", 4},
                                                                                {"Int64", 8},
                                                                                {"UInt64", 8},
                                                                                {"Int32", 4},
                                                                                {"UInt32", 4},
                                                                                {"Int16", 2},
                                                                                {"UInt16", 2},
                                                                                {"Int8", 1},
                                                                                {"UInt8", 1}}};
  for (const auto& [name, size] : kSizes)
    if (name == type) return size;
  return 0;
}

class Decoder {
 public:
  Decoder(const VtkArray& array, const VtkEncoding& encoding, FileAllowance& allowance, const Team& team)
      : array_(array), encoding_(encoding), allowance_(allowance), team_(team) {}

  [[noreturn]] void fail(const std::string& what) const {
    Scanner scan(encoding_.file);
    scan.go_to(std::min(place(), encoding_.file.size()));
    scan.fail("the array '" + array_.name.substr(0, 40) + "' " + what);
  }

  /// Calls begin(number of values), then more(bytes) for the values in order, some at a time.
  template <class Begin, class More>
  void read(const Begin& begin, const More& more) {
    const std::size_t size = size_of(array_.type);
    if (size == 0) fail("has the unknown type '" + array_.type.substr(0, 40) + "'");
    std::string_view stored;
    std::string decoded;
    if (array_.place == VtkPlace::Appended) {
      if (array_.offset > encoding_.file.size() - encoding_.appended) fail("begins behind the end of the file");
      stored = encoding_.file.substr(encoding_.appended + array_.offset);
      if (!encoding_.raw) stored = base64_of_array(stored, decoded);
    } else {
      stored = encoding_.file.substr(array_.text.begin, array_.text.length);
      if (!decode_base64(stored, decoded)) fail("is not base64");
      stored = decoded;
    }
    if (encoding_.compressed) return inflated(stored, size, begin, more);
    const std::string_view values = plain(stored);
    if (values.size() % size != 0) fail("ends inside a value");
    begin(values.size() / size);
    more(values);
  }

 private:
  std::size_t place() const {
    return array_.place == VtkPlace::Appended ? encoding_.appended + array_.offset : array_.text.begin;
  }

  std::size_t header_size() const { return encoding_.wide_headers ? 8 : 4; }

  std::uint64_t header(std::string_view stored, std::size_t index) const {
    const std::size_t size = header_size();
    if (stored.size() < (index + 1) * size) fail("ends inside its header");
    std::array<char, 8> number{};
    std::copy_n(stored.data() + index * size, size, number.data());
    if (encoding_.swapped) std::reverse(number.begin(), number.begin() + std::ptrdiff_t(size));
    std::uint32_t narrow = 0;
    std::uint64_t wide = 0;
    std::memcpy(&narrow, number.data(), 4);
    std::memcpy(&wide, number.data(), 8);
    return encoding_.wide_headers ? wide : narrow;
  }

  /// The bytes of an appended array in base64. Its header says how long it is; it may be encoded by itself.
  std::string_view base64_of_array(std::string_view text, std::string& decoded) {
    const auto decode = [&](std::size_t bytes) {
      const std::size_t length = std::min(text.size(), (bytes + 2) / 3 * 4);
      if (!decode_base64(text.substr(0, length / 4 * 4), decoded)) fail("is not base64");
      text.remove_prefix(length / 4 * 4);
    };
    const std::size_t first = header_size() * (encoding_.compressed ? 3 : 1);
    decode(first);
    std::uint64_t bytes = 0;
    if (encoding_.compressed) {
      const std::uint64_t blocks = header(decoded, 0);
      if (blocks > text.size()) fail("has more blocks than bytes");
      // The whole header is encoded at once, so its first part is decoded twice.
      const std::size_t all = header_size() * (3 + std::size_t(blocks));
      text = encoding_.file.substr(encoding_.appended + array_.offset);
      decoded.clear();
      decode(all);
      for (std::uint64_t block = 0; block < blocks; ++block)
        bytes += std::min<std::uint64_t>(header(decoded, 3 + block), text.size());
      if (bytes > text.size()) fail("is longer than the file");
      decoded.resize(all);
    } else {
      bytes = header(decoded, 0);
      if (bytes > text.size()) fail("is longer than the file");
      if (decoded.size() > first) {  // the header and the values are encoded at once
        text = encoding_.file.substr(encoding_.appended + array_.offset);
        decoded.clear();
        bytes += first;
      }
    }
    decode(std::size_t(bytes));
    return decoded;
  }

  std::string_view plain(std::string_view stored) {
    const std::uint64_t size = header(stored, 0);
    if (size > stored.size() - header_size()) fail("is incomplete");
    return stored.substr(header_size(), std::size_t(size));
  }

  template <class Begin, class More>
  void inflated(std::string_view stored, std::size_t value_size, const Begin& begin, const More& more) {
    const std::uint64_t blocks = header(stored, 0), block_size = header(stored, 1), last = header(stored, 2);
    constexpr std::uint64_t kLargest = std::uint64_t(1) << 40;
    if (blocks > stored.size() / header_size()) fail("has more blocks than bytes");
    if (blocks > stored.size() / header_size() - 3) fail("ends inside its header");
    if (block_size > kLargest || last > kLargest) fail("has a block of the wrong size");
    const std::uint64_t whole = blocks == 0 ? 0 : (blocks - 1) * block_size + (last > 0 ? last : block_size);
    if (whole / (blocks + 1) > kLargest) fail("has a block of the wrong size");
    if (whole % value_size != 0) fail("ends inside a value");
    begin(std::size_t(whole / value_size));
    // Several blocks are in memory at the same time if they are small.
    constexpr std::uint64_t kMostMemory = std::uint64_t(32) << 20;
    const std::uint64_t largest = std::max(block_size, last);
    const std::uint64_t at_once = std::min(blocks, std::uint64_t(team_.threads()) + 2);
    const bool shared = at_once > 1 && largest <= kMostMemory / at_once;
    if (shared) allowance_.take(std::size_t(at_once * largest), 1);
    std::uint64_t block = 0;
    std::size_t at = header_size() * (3 + std::size_t(blocks));
    const auto next = [&]() -> std::optional<Packed> {
      if (block == blocks) return std::nullopt;
      const std::uint64_t size = header(stored, 3 + std::size_t(block));
      const std::uint64_t whole_size = ++block == blocks && last > 0 ? last : block_size;
      if (at > stored.size() || size > stored.size() - at) return Packed{{}, 0, "is incomplete"};
      const std::string_view stream = stored.substr(std::exchange(at, at + std::size_t(size)), std::size_t(size));
      // No zlib stream becomes larger by more than this factor.
      if (whole_size / 1040 > size) return Packed{{}, 0, kWrongSize};
      if (!shared) allowance_.take(std::size_t(whole_size), 1);
      return Packed{stream, std::size_t(whole_size), nullptr};
    };
    std::string rest;  // bytes that are not a whole value yet
    in_order(shared ? team_ : Team(1), next, unpacked, [&](const Unpacked& made) {
      if (made.fault != nullptr) fail(made.fault);
      std::string_view bytes(made.bytes.data(), made.bytes.size());
      if (!rest.empty() || bytes.size() % value_size != 0) {
        rest += bytes;
        bytes = rest;
      }
      const std::size_t complete = bytes.size() / value_size * value_size;
      more(bytes.substr(0, complete));
      rest = std::string(bytes.substr(complete));
      if (!shared) allowance_.give_back(made.bytes.size());
      return true;
    });
    if (shared) allowance_.give_back(std::size_t(at_once * largest));
  }

  /// A block that is to be unpacked, or what is wrong with it.
  struct Packed {
    std::string_view stream;
    std::size_t size;
    const char* fault;
  };
  struct Unpacked {
    UntouchedVector<char> bytes;
    const char* fault;
  };
  static constexpr const char* kWrongSize = "has a block of the wrong size";

  static Unpacked unpacked(const Packed& block) {
    if (block.fault != nullptr) return {{}, block.fault};
    Unpacked made{UntouchedVector<char>(block.size), nullptr};
    if (read_stored_stream(block.stream, {made.bytes.data(), made.bytes.size()})) return made;
    // Bytes after the end of the zlib stream mean nothing.
    char none = 0;
    uLongf size = uLongf(block.size);
    uLong length = uLong(block.stream.size());
    const int status = uncompress2(reinterpret_cast<Bytef*>(block.size > 0 ? made.bytes.data() : &none), &size,
                                   reinterpret_cast<const Bytef*>(block.stream.data()), &length);
    if (status == Z_MEM_ERROR) throw std::bad_alloc();
    if (status != Z_OK && status != Z_BUF_ERROR) return {{}, "is damaged or incomplete"};
    if (status == Z_BUF_ERROR || size != block.size) return {{}, kWrongSize};
    return made;
  }

  const VtkArray& array_;
  const VtkEncoding& encoding_;
  FileAllowance& allowance_;
  const Team& team_;
};

/// Appends the values of some bytes. Throws if a value is no To.
template <class From, class To>
void append(const Decoder& decoder, std::string_view bytes, bool swapped, std::vector<To>& values) {
  if (std::is_same_v<From, To> && !swapped) {
    const std::size_t before = values.size();
    values.resize(before + bytes.size() / sizeof(To));
    std::memcpy(values.data() + before, bytes.data(), (values.size() - before) * sizeof(To));
    return;
  }
  for (std::size_t at = 0; at < bytes.size(); at += sizeof(From)) {
    std::array<char, sizeof(From)> raw;
    std::memcpy(raw.data(), bytes.data() + at, sizeof(From));
    if (swapped) std::reverse(raw.begin(), raw.end());
    From value;
    std::memcpy(&value, raw.data(), sizeof(From));
    if constexpr (std::is_integral_v<To> && std::is_integral_v<From>)
      if (!std::in_range<To>(value)) decoder.fail("has the value " + std::to_string(value) + ", which is too large");
    values.push_back(To(value));
  }
}

template <class To>
using Append = void (*)(const Decoder&, std::string_view, bool, std::vector<To>&);

/// Null if values of this type are no To.
template <class To>
Append<To> append_of(std::string_view type) {
  if (std::is_integral_v<To> && type.starts_with("Float")) return nullptr;
  if (type == "Float64") return append<double, To>;
  if (type == "Float32") return append<float, To>;
  if (type == "Int64") return append<std::int64_t, To>;
  if (type == "UInt64") return append<std::uint64_t, To>;
  if (type == "Int32") return append<std::int32_t, To>;
  if (type == "UInt32") return append<std::uint32_t, To>;
  if (type == "Int16") return append<std::int16_t, To>;
  if (type == "UInt16") return append<std::uint16_t, To>;
  return type == "Int8" ? append<std::int8_t, To> : append<std::uint8_t, To>;
}

template <class To>
std::vector<To> values_of_text(const VtkArray& array, const Decoder& decoder, const VtkEncoding& encoding,
                               FileAllowance& allowance) {
  if (size_of(array.type) == 0) decoder.fail("has the unknown type '" + array.type.substr(0, 40) + "'");
  std::vector<To> values;
  Scanner scan(encoding.file.substr(0, array.text.begin + array.text.length));
  scan.go_to(array.text.begin);
  for (scan.skip_space(); !scan.at_end(); scan.skip_space()) {
    allowance.take(1, sizeof(To));
    if constexpr (std::is_integral_v<To>) {
      const std::int64_t value = scan.text_integer("a value of an array");
      if (!std::in_range<To>(value)) decoder.fail("has the value " + std::to_string(value) + ", which is too large");
      values.push_back(To(value));
    } else {
      values.push_back(scan.text_number("a value of an array"));
    }
  }
  return values;
}

}  // namespace

template <class T>
std::vector<T> vtk_values(const VtkArray& array, std::optional<std::size_t> count, const VtkEncoding& encoding,
                          FileAllowance& allowance, const Team& team) {
  Decoder decoder(array, encoding, allowance, team);
  const Append<T> append = append_of<T>(array.type);
  if (append == nullptr) decoder.fail("must have whole numbers");
  const auto check = [&](std::size_t own) {
    if (count && own != *count)
      decoder.fail("has " + std::to_string(own) + " values; " + std::to_string(*count) + " were expected");
  };
  std::vector<T> values;
  if (array.place == VtkPlace::Text) {
    values = values_of_text<T>(array, decoder, encoding, allowance);
    check(values.size());
    return values;
  }
  decoder.read(
      [&](std::size_t own) {
        check(own);
        allowance.take(own, sizeof(T));
        reserve_large(values, own);
      },
      [&](std::string_view bytes) { append(decoder, bytes, encoding.swapped, values); });
  return values;
}

void for_vtk_values(const VtkArray& array, const VtkEncoding& encoding, FileAllowance& allowance, const Team& team,
                    const std::function<void(std::size_t)>& begin,
                    const std::function<void(std::span<const std::int32_t>)>& body) {
  std::vector<std::int32_t> values;
  if (array.place == VtkPlace::Text) {
    values = vtk_values<std::int32_t>(array, std::nullopt, encoding, allowance, team);
    begin(values.size());
    return body(values);
  }
  Decoder decoder(array, encoding, allowance, team);
  const Append<std::int32_t> append = append_of<std::int32_t>(array.type);
  if (append == nullptr) decoder.fail("must have whole numbers");
  decoder.read(begin, [&](std::string_view bytes) {
    constexpr std::size_t kBytes = std::size_t(1) << 16;  // a multiple of every size
    for (; !bytes.empty(); bytes.remove_prefix(std::min(kBytes, bytes.size()))) {
      allowance.look_now();
      values.clear();
      append(decoder, bytes.substr(0, kBytes), encoding.swapped, values);
      body(values);
    }
  });
}

template std::vector<double> vtk_values(const VtkArray&, std::optional<std::size_t>, const VtkEncoding&, FileAllowance&,
                                        const Team&);
template std::vector<std::int64_t> vtk_values(const VtkArray&, std::optional<std::size_t>, const VtkEncoding&,
                                              FileAllowance&, const Team&);
template std::vector<std::int32_t> vtk_values(const VtkArray&, std::optional<std::size_t>, const VtkEncoding&,
                                              FileAllowance&, const Team&);
template std::vector<std::uint8_t> vtk_values(const VtkArray&, std::optional<std::size_t>, const VtkEncoding&,
                                              FileAllowance&, const Team&);

}  // namespace varimesh::formats
