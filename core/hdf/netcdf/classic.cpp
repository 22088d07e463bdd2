#include "core/hdf/netcdf/classic.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "core/base/io/allowance.h"

namespace varimesh::formats {

namespace {

using hdf5::Kind;

constexpr std::uint32_t kDimensions = 10, kVariables = 11, kAttributes = 12;

[[noreturn]] void fail(const std::string& fault) {
  throw ReadFailure{"The mesh file cannot be read: as a netCDF file, it " + fault +
                    ". The file is damaged; write or copy it again."};
}

/// A type of values, by its number in the file.
struct Type {
  Kind kind = Kind::Other;
  std::size_t bytes = 1;
  bool is_signed = true;
};

Type type_of(std::uint32_t number) {
  static constexpr Type kTypes[] = {{Kind::Integers, 1},        {Kind::Texts, 1},           {Kind::Integers, 2},
                                    {Kind::Integers, 4},        {Kind::Numbers, 4},         {Kind::Numbers, 8},
                                    {Kind::Integers, 1, false}, {Kind::Integers, 2, false}, {Kind::Integers, 4, false},
                                    {Kind::Integers, 8},        {Kind::Integers, 8, false}};
  if (number < 1 || number > std::size(kTypes)) fail("has values of the unknown type " + std::to_string(number));
  return kTypes[number - 1];
}

/// An unsigned number of `bytes` bytes, the highest byte first.
std::uint64_t big_endian(const char* at, std::size_t bytes) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < bytes; ++i) value = value << 8U | static_cast<unsigned char>(at[i]);
  return value;
}

std::int64_t integer(const char* at, const Type& type) {
  const auto unused = static_cast<unsigned>(8 * (8 - type.bytes));
  const std::uint64_t value = big_endian(at, type.bytes) << unused;
  return type.is_signed ? static_cast<std::int64_t>(value) >> unused : static_cast<std::int64_t>(value >> unused);
}

double number(const char* at, const Type& type) {
  if (type.kind == Kind::Integers) return static_cast<double>(integer(at, type));
  const std::uint64_t bits = big_endian(at, type.bytes);
  return type.bytes == 4 ? static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)))
                         : std::bit_cast<double>(bits);
}

/// Reads the header from its beginning to its end.
class Header {
 public:
  explicit Header(std::string_view bytes) : bytes_(bytes), version_(bytes.size() > 3 ? bytes[3] : '\0') {
    take(4);
    if (version_ != 1 && version_ != 2 && version_ != 5) fail("has an unknown version");
  }

  std::size_t at() const { return at_; }
  std::string_view take(std::size_t count) {
    if (count > bytes_.size() - at_) fail("ends within its header");
    at_ += count;
    return bytes_.substr(at_ - count, count);
  }
  std::uint32_t word() { return static_cast<std::uint32_t>(big_endian(take(4).data(), 4)); }
  std::uint64_t count() { return version_ == 5 ? big_endian(take(8).data(), 8) : word(); }
  std::uint64_t offset() { return version_ == 1 ? word() : big_endian(take(8).data(), 8); }
  /// So many bytes, and what fills them up to a multiple of four.
  std::string_view padded(std::uint64_t size) {
    if (size > bytes_.size()) fail("ends within its header");
    const std::string_view all = take(static_cast<std::size_t>((size + 3) / 4 * 4));
    return all.substr(0, static_cast<std::size_t>(size));
  }
  std::string_view name() { return padded(count()); }
  /// The length of a list of this kind.
  std::uint64_t list(std::uint32_t kind) {
    const std::uint32_t tag = word();
    const std::uint64_t length = count();
    if (tag != kind && (tag != 0 || length != 0))
      fail("has another list where one of the kind " + std::to_string(kind) + " must be");
    return length;
  }

 private:
  const std::string_view bytes_;
  const char version_;
  std::size_t at_ = 0;
};

/// A variable or an attribute: what it is, and where its values are.
struct Array {
  Hdf5Item item;
  Type type;
  std::uint64_t begin = 0;
  std::vector<Array> attributes;
};

class NetcdfFile : public Hdf5Source {
 public:
  NetcdfFile(std::string_view bytes, FileAllowance& allowance) : bytes_(bytes) {
    Header header(bytes);
    header.count();  // the number of time steps
    struct Dimension {
      std::int64_t length;
      bool grows;
    };
    std::vector<Dimension> dimensions;
    for (std::uint64_t left = header.list(kDimensions); left > 0; --left) {
      header.name();
      const std::uint64_t length = header.count();
      if (length > std::uint64_t(INT64_MAX)) fail("has a dimension that is too long");
      allowance.make_room(dimensions, 1);
      dimensions.push_back({static_cast<std::int64_t>(length), length == 0});
    }
    file_.attributes = attributes_from(header, allowance);
    for (std::uint64_t left = header.list(kVariables); left > 0; --left) {
      Array array;
      array.item.name = name_from(header, allowance);
      bool grows = false;
      for (std::uint64_t rank = header.count(); rank > 0; --rank) {
        const std::uint64_t id = header.count();
        if (id >= dimensions.size()) fail("has an array with a dimension that does not exist");
        grows = grows || dimensions[id].grows;
        allowance.make_room(array.item.dims, 1);
        array.item.dims.push_back(dimensions[id].length);
      }
      array.attributes = attributes_from(header, allowance);
      array.type = type_of(header.word());
      header.count();  // the size, which follows from the dimensions
      array.begin = header.offset();
      array.item.kind = grows ? Kind::Other : array.type.kind;
      array.item.width = array.item.kind == Kind::Texts ? 1 : 0;
      allowance.make_room(variables_, 1);
      variables_.push_back(std::move(array));
    }
    allowance.take(variables_.size(), 2 * kAllocation + sizeof(std::pair<std::string_view, const Array*>));
    for (const Array& array : variables_) by_name_.try_emplace(array.item.name, &array);
  }

  std::vector<Hdf5Item> list(const std::string& group, FileAllowance& allowance) override {
    std::vector<Hdf5Item> items;
    const auto add = [&](const std::vector<Array>& arrays) {
      for (const Array& array : arrays) {
        allowance.take(2, sizeof array.item + kAllocation);
        allowance.take(1, array.item.name.size() + array.item.dims.size() * sizeof array.item.dims[0]);
        items.push_back(array.item);
      }
    };
    if (group == "/") add(variables_);
    add(owner(group).attributes);
    return items;
  }

  void read(const std::string& path, Kind kind, std::int64_t first, std::span<char> out, std::int64_t count) override {
    const std::size_t line = path.find('\n');
    const Array& of = owner(std::string_view(path).substr(0, line));
    const Array& array = line == std::string::npos ? of : attribute_of(of, std::string_view(path).substr(line + 1));
    if (array.item.kind != kind && !(array.item.kind == Kind::Integers && kind == Kind::Numbers))
      fail("has an array that is not of the kind that is needed");
    const std::size_t width = kind == Kind::Texts ? std::max<std::size_t>(1, array.item.width) : 8;
    const std::int64_t columns = array.item.columns(), rows = array.item.rows();
    const bool is_within = first >= 0 && count >= 0 && first <= rows && count <= rows - first;
    // Neither product below is larger than an integer if these hold.
    const bool is_small = columns <= hdf5::kMostBytes && (columns == 0 || count <= hdf5::kMostBytes / columns) &&
                          first <= INT64_MAX / std::max<std::int64_t>(1, columns);
    if (!is_within || !is_small || out.size() != std::size_t(count * columns) * width)
      fail("has an array of another size than was said");
    // A text of n bytes counts as n values of one byte.
    const std::size_t values = kind == Kind::Texts ? out.size() : out.size() / width;
    const std::string_view from = values_of(array, std::uint64_t(first) * std::uint64_t(columns), values);
    for (std::size_t i = 0; i < values; ++i) put(from.data() + i * array.type.bytes, array.type, kind, i, out);
  }

 private:
  /// A name, whose memory is taken from the allowance.
  static std::string name_from(Header& header, FileAllowance& allowance) {
    const std::string_view name = header.name();
    allowance.take(1, name.size() + kAllocation);
    return std::string(name);
  }

  std::vector<Array> attributes_from(Header& header, FileAllowance& allowance) {
    std::vector<Array> all;
    for (std::uint64_t left = header.list(kAttributes); left > 0; --left) {
      const std::string_view name = header.name();
      Array array;
      array.type = type_of(header.word());
      const std::uint64_t length = header.count();
      if (length > bytes_.size()) fail("ends within its header");
      array.begin = header.at();
      header.padded(length * array.type.bytes);
      if (length == 0) continue;
      allowance.take(1, name.size() + sizeof array.item.dims[0] + 2 * kAllocation);
      array.item.name = name;
      array.item.attribute = true;
      array.item.kind = array.type.kind;
      if (array.item.kind == Kind::Texts)
        array.item.width = static_cast<std::size_t>(length);
      else
        array.item.dims = {static_cast<std::int64_t>(length)};
      allowance.make_room(all, 1);
      all.push_back(std::move(array));
    }
    return all;
  }

  [[noreturn]] static void fail_without(std::string_view name) {
    fail("has no '" + std::string(name.substr(0, 100)) + "'");
  }

  /// An owner has few attributes, and they are read once.
  static const Array& attribute_of(const Array& owner, std::string_view name) {
    const auto found =
        std::ranges::find_if(owner.attributes, [&](const Array& array) { return array.item.name == name; });
    if (found == owner.attributes.end()) fail_without(name);
    return *found;
  }

  /// The file itself for "/", or the variable with this path.
  const Array& owner(std::string_view path) const {
    if (path == "/") return file_;
    const auto found = by_name_.find(path.substr(1));
    if (found == by_name_.end()) fail_without(path.substr(1));
    return *found->second;
  }

  std::string_view values_of(const Array& array, std::uint64_t first, std::size_t count) const {
    const std::uint64_t room = array.begin > bytes_.size() ? 0 : (bytes_.size() - array.begin) / array.type.bytes;
    if (first > room || count > room - first)
      fail("ends before the values of '" + array.item.name.substr(0, 100) + "'");
    return bytes_.substr(array.begin + first * array.type.bytes, count * array.type.bytes);
  }

  static void put(const char* from, const Type& type, Kind kind, std::size_t at, std::span<char> out) {
    if (kind == Kind::Texts) {
      out[at] = *from;
    } else if (kind == Kind::Integers) {
      const std::int64_t value = integer(from, type);
      std::memcpy(out.data() + at * sizeof value, &value, sizeof value);
    } else {
      const double value = number(from, type);
      std::memcpy(out.data() + at * sizeof value, &value, sizeof value);
    }
  }

  const std::string_view bytes_;
  Array file_;
  std::vector<Array> variables_;
  std::unordered_map<std::string_view, const Array*> by_name_;  ///< The first variable with each name.
};

}  // namespace

std::unique_ptr<Hdf5Source> open_netcdf(std::string_view bytes, FileAllowance& allowance) {
  return std::make_unique<NetcdfFile>(bytes, allowance);
}

}  // namespace varimesh::formats
