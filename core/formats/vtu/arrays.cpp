#include "core/formats/vtu/arrays.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "core/formats/scanner.h"
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
  Decoder(const VtkArray& array, const VtkEncoding& encoding, FileAllowance& allowance)
      : array_(array), encoding_(encoding), allowance_(allowance) {}

  [[noreturn]] void fail(const std::string& what) const {
    Scanner scan(encoding_.file);
    scan.go_to(std::min(place(), encoding_.file.size()));
    scan.fail("the array '" + array_.name.substr(0, 40) + "' " + what);
  }

  /// The values' bytes, in this machine's order.
  std::string bytes() {
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
    std::string values = encoding_.compressed ? inflated(stored) : plain(stored);
    if (values.size() % size != 0) fail("ends inside a value");
    if (encoding_.swapped && size > 1)
      for (std::size_t at = 0; at < values.size(); at += size)
        std::reverse(values.begin() + std::ptrdiff_t(at), values.begin() + std::ptrdiff_t(at + size));
    return values;
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

  std::string plain(std::string_view stored) {
    const std::uint64_t size = header(stored, 0);
    if (size > stored.size() - header_size()) fail("is incomplete");
    allowance_.take(std::size_t(size), 1);
    return std::string(stored.substr(header_size(), std::size_t(size)));
  }

  std::string inflated(std::string_view stored) {
    const std::uint64_t blocks = header(stored, 0), block_size = header(stored, 1), last = header(stored, 2);
    if (blocks > stored.size() / header_size()) fail("has more blocks than bytes");
    std::size_t at = header_size() * (3 + std::size_t(blocks));
    std::string values;
    for (std::uint64_t block = 0; block < blocks; ++block) {
      const std::uint64_t size = header(stored, 3 + std::size_t(block));
      if (at > stored.size() || size > stored.size() - at) fail("is incomplete");
      const std::size_t before = values.size();
      // Bytes after the end of the zlib stream mean nothing.
      if (!inflate_zlib(stored.substr(at, std::size_t(size)), values, allowance_)) fail("is damaged or incomplete");
      const std::uint64_t wanted = block + 1 == blocks && last > 0 ? last : block_size;
      if (values.size() - before != wanted) fail("has a block of the wrong size");
      at += std::size_t(size);
    }
    return values;
  }

  const VtkArray& array_;
  const VtkEncoding& encoding_;
  FileAllowance& allowance_;
};

template <class To, class From>
void convert(const std::string& bytes, std::vector<To>& values) {
  values.resize(bytes.size() / sizeof(From));
  for (std::size_t i = 0; i < values.size(); ++i) {
    From value;
    std::memcpy(&value, bytes.data() + i * sizeof(From), sizeof(From));
    values[i] = To(value);
  }
}

template <class To>
std::vector<To> values_of(const VtkArray& array, const VtkEncoding& encoding, FileAllowance& allowance) {
  Decoder decoder(array, encoding, allowance);
  const std::string_view type = array.type;
  constexpr bool kWhole = std::is_same_v<To, std::int64_t>;
  if (kWhole && type.starts_with("Float")) decoder.fail("must have whole numbers");
  std::vector<To> values;
  if (array.place == VtkPlace::Text) {
    if (size_of(type) == 0) decoder.fail("has the unknown type '" + array.type.substr(0, 40) + "'");
    Scanner scan(encoding.file.substr(0, array.text.begin + array.text.length));
    scan.go_to(array.text.begin);
    for (scan.skip_space(); !scan.at_end(); scan.skip_space()) {
      allowance.take(1, sizeof(To));
      if constexpr (kWhole)
        values.push_back(scan.text_integer("a value of an array"));
      else
        values.push_back(scan.text_number("a value of an array"));
    }
    return values;
  }
  const std::string bytes = decoder.bytes();
  allowance.take(bytes.size() / size_of(type), sizeof(To));
  if (type == "Float64")
    convert<To, double>(bytes, values);
  else if (type == "Float32")
    convert<To, float>(bytes, values);
  else if (type == "Int64" || type == "UInt64")
    convert<To, std::int64_t>(bytes, values);
  else if (type == "Int32")
    convert<To, std::int32_t>(bytes, values);
  else if (type == "UInt32")
    convert<To, std::uint32_t>(bytes, values);
  else if (type == "Int16")
    convert<To, std::int16_t>(bytes, values);
  else if (type == "UInt16")
    convert<To, std::uint16_t>(bytes, values);
  else if (type == "Int8")
    convert<To, std::int8_t>(bytes, values);
  else
    convert<To, std::uint8_t>(bytes, values);
  return values;
}

template <class To>
std::vector<To> exactly(std::size_t count, std::vector<To> values, const VtkArray& array, const VtkEncoding& encoding,
                        FileAllowance& allowance) {
  if (values.size() != count)
    Decoder(array, encoding, allowance)
        .fail("has " + std::to_string(values.size()) + " values; " + std::to_string(count) + " were expected");
  return values;
}

}  // namespace

std::vector<double> vtk_numbers(const VtkArray& array, std::size_t count, const VtkEncoding& encoding,
                                FileAllowance& allowance) {
  return exactly(count, values_of<double>(array, encoding, allowance), array, encoding, allowance);
}

std::vector<std::int64_t> vtk_integers(const VtkArray& array, std::size_t count, const VtkEncoding& encoding,
                                       FileAllowance& allowance) {
  return exactly(count, vtk_integers(array, encoding, allowance), array, encoding, allowance);
}

std::vector<std::int64_t> vtk_integers(const VtkArray& array, const VtkEncoding& encoding, FileAllowance& allowance) {
  return values_of<std::int64_t>(array, encoding, allowance);
}

}  // namespace varimesh::formats
