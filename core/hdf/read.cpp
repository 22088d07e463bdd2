#include "core/hdf/read.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <vector>

#include "core/hdf/types.h"

namespace varimesh::hdf {

namespace {

using formats::hdf5::Kind;

constexpr std::size_t kMostListed = 100'000;
constexpr std::size_t kMostTextBytes = 1 << 16;

/// A dataset or an attribute of the file, and its type and extent there.
struct Array {
  Handle object, type, space;
  bool attribute;

  Array(Handle opened, bool is_attribute)
      : object(std::move(opened)),
        type(is_attribute ? H5Aget_type(object) : H5Dget_type(object), H5Tclose, "an array has no type"),
        space(is_attribute ? H5Aget_space(object) : H5Dget_space(object), H5Sclose, "an array has no extent"),
        attribute(is_attribute) {}

  std::vector<hsize_t> dims() const {
    const int rank = H5Sget_simple_extent_ndims(space);
    if (rank < 0) throw Refusal("an array has no extent");
    std::vector<hsize_t> all(std::size_t(rank), 0);
    if (rank > 0) check(H5Sget_simple_extent_dims(space, all.data(), nullptr), "an array has no extent");
    return all;
  }
  /// A text without a fixed length has at most this many bytes here.
  std::size_t width() const {
    if (kind_of(type) != Kind::Texts) return 0;
    return H5Tis_variable_str(type) > 0 ? 256 : std::min(H5Tget_size(type), kMostTextBytes);
  }
  /// Values that lie in other files, or in other arrays, are not read.
  Kind kind() const {
    if (!attribute) {
      const Handle made(H5Dget_create_plist(object), H5Pclose, "an array cannot be opened");
      const H5D_layout_t layout = H5Pget_layout(made);
      if (H5Pget_external_count(made) != 0 || layout == H5D_VIRTUAL || layout < 0) return Kind::Other;
    }
    return kind_of(type);
  }
};

/// Whether every part of the path is a member of the file itself: a link to another file could make the program read
/// what its caller must not see.
void check_path(hid_t file, const std::string& path) {
  for (std::size_t end = 0; end != std::string::npos && path != "/";) {
    end = path.find('/', end + 1);
    const std::string part = path.substr(0, end);
    H5L_info_t link;
    if (H5Lexists(file, part.c_str(), H5P_DEFAULT) <= 0 || H5Lget_info(file, part.c_str(), &link, H5P_DEFAULT) < 0 ||
        link.type != H5L_TYPE_HARD)
      throw Refusal("it has no '" + part.substr(0, 100) + "' of its own");
  }
}

Array open(hid_t file, const std::string& path) {
  const std::size_t line = path.find('\n');
  const std::string owner = path.substr(0, line);
  check_path(file, owner);
  if (line == std::string::npos)
    return {Handle(H5Dopen2(file, owner.c_str(), H5P_DEFAULT), H5Dclose, "an array cannot be opened"), false};
  const std::string name = path.substr(line + 1);
  return {Handle(H5Aopen_by_name(file, owner.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose,
                 "an attribute cannot be opened"),
          true};
}

std::string line_of(Kind kind, bool attribute, std::size_t width, const std::vector<hsize_t>& dims, const char* name) {
  std::string line(1, char(kind));
  line += attribute ? "\ta\t" : "\tm\t";
  line += std::to_string(width) + "\t";
  for (std::size_t i = 0; i < dims.size(); ++i) line += (i > 0 ? " " : "") + std::to_string(dims[i]);
  return line + "\t" + name + "\n";
}

struct Listing {
  hid_t file;
  std::string path;
  std::string text;
  std::size_t count = 0;
};

bool is_plain(const char* name) {
  return std::none_of(name, name + std::strlen(name), [](unsigned char c) { return c < ' '; });
}

// HDF5 is written in C, so that no exception may pass through it.
herr_t add_member(hid_t group, const char* name, const H5L_info_t* link, void* data) noexcept {
  auto& listing = *static_cast<Listing*>(data);
  if (++listing.count > kMostListed) return -1;
  if (!is_plain(name)) return 0;
  try {
    H5O_info_t object;
    if (link->type != H5L_TYPE_HARD || H5Oget_info_by_name(group, name, &object, H5P_DEFAULT) < 0) {
      listing.text += line_of(Kind::Other, false, 0, {}, name);
    } else if (object.type == H5O_TYPE_GROUP) {
      listing.text += line_of(Kind::Group, false, 0, {}, name);
    } else if (object.type == H5O_TYPE_DATASET) {
      const Array array(Handle(H5Dopen2(group, name, H5P_DEFAULT), H5Dclose, "an array cannot be opened"), false);
      listing.text += line_of(array.kind(), false, array.width(), array.dims(), name);
    }
  } catch (const std::exception&) {
    return -1;
  }
  return 0;
}

herr_t add_attribute(hid_t owner, const char* name, const H5A_info_t*, void* data) noexcept {
  auto& listing = *static_cast<Listing*>(data);
  if (++listing.count > kMostListed) return -1;
  if (!is_plain(name)) return 0;
  try {
    const Array array(Handle(H5Aopen(owner, name, H5P_DEFAULT), H5Aclose, "an attribute cannot be opened"), true);
    listing.text += line_of(array.kind(), true, array.width(), array.dims(), name);
  } catch (const std::exception&) {
    return -1;
  }
  return 0;
}

/// Texts without a fixed length, as texts of `width` bytes.
std::string fixed_texts(const Array& array, hid_t memory, hid_t selected, std::size_t count) {
  const Handle type(H5Tcopy(H5T_C_S1), H5Tclose, "a type cannot be made");
  check(H5Tset_size(type, H5T_VARIABLE), "a type cannot be made");
  (void)H5Tset_cset(type, H5Tget_cset(array.type));
  std::vector<char*> texts(count, nullptr);
  check(array.attribute ? H5Aread(array.object, type, texts.data())
                        : H5Dread(array.object, type, memory, selected, H5P_DEFAULT, texts.data()),
        "values cannot be read");
  const std::size_t width = array.width();
  std::string bytes(count * width, '\0');
  for (std::size_t i = 0; i < count; ++i)
    if (texts[i] != nullptr) std::memcpy(bytes.data() + i * width, texts[i], std::min(width, std::strlen(texts[i])));
  (void)H5Dvlen_reclaim(type, memory, H5P_DEFAULT, texts.data());
  return bytes;
}

Handle memory_type(Kind kind, std::size_t width) {
  if (kind == Kind::Integers) return {H5Tcopy(H5T_NATIVE_INT64), H5Tclose, "a type cannot be made"};
  if (kind == Kind::Numbers) return {H5Tcopy(H5T_NATIVE_DOUBLE), H5Tclose, "a type cannot be made"};
  return type_of("S" + std::to_string(width));
}

}  // namespace

std::string list(hid_t file, const std::string& path) {
  check_path(file, path);
  const Handle group(H5Gopen2(file, path.c_str(), H5P_DEFAULT), H5Gclose, "a group cannot be opened");
  Listing listing{file, path, {}, 0};
  hsize_t at = 0;
  check(H5Literate(group, H5_INDEX_NAME, H5_ITER_INC, &at, add_member, &listing), "a group cannot be listed");
  at = 0;
  check(H5Aiterate2(group, H5_INDEX_NAME, H5_ITER_INC, &at, add_attribute, &listing), "attributes cannot be listed");
  return listing.text;
}

std::string read(hid_t file, const std::string& path, Kind kind, std::int64_t first, std::int64_t count) {
  const Array array = open(file, path);
  const Kind own = array.kind();
  const bool fits = own == kind || (own == Kind::Integers && kind == Kind::Numbers);
  if (!fits) throw Refusal("an array is not of the kind that is needed");
  std::vector<hsize_t> dims = array.dims();
  if (dims.empty()) dims = {1};
  if (first < 0 || count < 0 || hsize_t(first) > dims[0] || hsize_t(count) > dims[0] - hsize_t(first))
    throw Refusal("an array has fewer rows than are needed");
  const std::size_t width = kind == Kind::Texts ? array.width() : 8;
  hsize_t values = hsize_t(count);
  for (std::size_t i = 1; i < dims.size(); ++i) {
    if (dims[i] > hsize_t(formats::hdf5::kMostBytes)) throw Refusal("an array has rows that are too long");
    values *= dims[i];
    if (values > hsize_t(formats::hdf5::kMostBytes)) throw Refusal("an array has rows that are too long");
  }
  if (width == 0 || values * width > hsize_t(formats::hdf5::kMostBytes)) throw Refusal("too many rows are asked for");
  if (values == 0) return {};

  const Handle memory(H5Screate_simple(1, &values, nullptr), H5Sclose, "there is too little memory");
  const Handle selected(H5Scopy(array.space), H5Sclose, "there is too little memory");
  if (array.attribute) {
    if (hsize_t(count) != dims[0]) throw Refusal("an attribute is read as a whole");
  } else if (H5Sget_simple_extent_ndims(selected) > 0) {
    std::vector<hsize_t> from(dims.size(), 0), much = dims;
    from[0] = hsize_t(first);
    much[0] = hsize_t(count);
    check(H5Sselect_hyperslab(selected, H5S_SELECT_SET, from.data(), nullptr, much.data(), nullptr),
          "rows cannot be selected");
  }
  if (kind == Kind::Texts && H5Tis_variable_str(array.type) > 0) return fixed_texts(array, memory, selected, values);
  const Handle type = memory_type(kind, width);
  std::string bytes(values * width, '\0');
  check(array.attribute ? H5Aread(array.object, type, bytes.data())
                        : H5Dread(array.object, type, memory, selected, H5P_DEFAULT, bytes.data()),
        "values cannot be read");
  return bytes;
}

std::string place(hid_t file, const std::string& path) {
  const Array array = open(file, path);
  if (array.attribute || array.kind() == Kind::Other) return {};
  const Handle made(H5Dget_create_plist(array.object), H5Pclose, "an array cannot be opened");
  if (H5Pget_layout(made) != H5D_CONTIGUOUS) return {};
  const haddr_t begin = H5Dget_offset(array.object);
  if (begin == HADDR_UNDEF) return {};
  for (const std::string name : {"i1", "i2", "i4", "i8", "f4", "f8"})
    if (H5Tequal(array.type, type_of(name)) > 0) return name + " " + std::to_string(begin);
  return {};
}

}  // namespace varimesh::hdf
