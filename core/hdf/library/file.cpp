#include "core/hdf/library/file.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <exception>
#include <string>
#include <utility>
#include <vector>

#include "core/hdf/library/types.h"

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

struct Listing {
  std::vector<formats::Hdf5Item> items;
  formats::FileAllowance& allowance;
  std::size_t count = 0;
  std::exception_ptr failure = nullptr;

  void add(formats::Hdf5Item item) {
    allowance.take(2, sizeof item + kAllocation);
    allowance.take(1, item.name.size() + item.dims.size() * sizeof item.dims[0]);
    items.push_back(std::move(item));
  }
};

formats::Hdf5Item item_of(const Array& array, const char* name) {
  formats::Hdf5Item item{array.kind(), array.attribute, array.width(), {}, name};
  for (const hsize_t n : array.dims()) item.dims.push_back(std::int64_t(std::min<hsize_t>(n, INT64_MAX)));
  return item;
}

bool is_plain(const char* name) {
  return std::none_of(name, name + std::strlen(name), [](unsigned char c) { return c < ' '; });
}

/// Calls body(), and keeps what it throws: HDF5 is written in C, so that no exception may pass through it.
template <class Body>
herr_t guarded(Listing& listing, const char* name, const Body& body) noexcept {
  if (++listing.count > kMostListed) return -1;
  if (!is_plain(name)) return 0;
  try {
    body();
    return 0;
  } catch (...) {
    listing.failure = std::current_exception();
    return -1;
  }
}

/// What a member of a group is. HDF5 1.12 and later want to know what to look for.
bool look_at_member(hid_t group, const char* name, H5O_info_t& object) {
#if H5_VERSION_GE(1, 12, 0)
  return H5Oget_info_by_name(group, name, &object, H5O_INFO_BASIC, H5P_DEFAULT) >= 0;
#else
  return H5Oget_info_by_name(group, name, &object, H5P_DEFAULT) >= 0;
#endif
}

herr_t add_member(hid_t group, const char* name, const H5L_info_t* link, void* data) noexcept {
  auto& listing = *static_cast<Listing*>(data);
  return guarded(listing, name, [&] {
    H5O_info_t object;
    if (link->type != H5L_TYPE_HARD || !look_at_member(group, name, object))
      listing.add({Kind::Other, false, 0, {}, name});
    else if (object.type == H5O_TYPE_GROUP)
      listing.add({Kind::Group, false, 0, {}, name});
    else if (object.type == H5O_TYPE_DATASET)
      listing.add(
          item_of({Handle(H5Dopen2(group, name, H5P_DEFAULT), H5Dclose, "an array cannot be opened"), false}, name));
  });
}

herr_t add_attribute(hid_t owner, const char* name, const H5A_info_t*, void* data) noexcept {
  auto& listing = *static_cast<Listing*>(data);
  return guarded(listing, name, [&] {
    listing.add(
        item_of({Handle(H5Aopen(owner, name, H5P_DEFAULT), H5Aclose, "an attribute cannot be opened"), true}, name));
  });
}

/// Reads texts without a fixed length as texts of `width` bytes.
void read_fixed_texts(const Array& array, hid_t memory, hid_t selected, std::span<char> out) {
  const Handle type(H5Tcopy(H5T_C_S1), H5Tclose, "a type cannot be made");
  check(H5Tset_size(type, H5T_VARIABLE), "a type cannot be made");
  (void)H5Tset_cset(type, H5Tget_cset(array.type));
  const std::size_t width = array.width();
  std::vector<char*> texts(out.size() / width, nullptr);
  check(array.attribute ? H5Aread(array.object, type, texts.data())
                        : H5Dread(array.object, type, memory, selected, H5P_DEFAULT, texts.data()),
        "values cannot be read");
  std::fill(out.begin(), out.end(), '\0');
  for (std::size_t i = 0; i < texts.size(); ++i)
    if (texts[i] != nullptr) std::memcpy(out.data() + i * width, texts[i], std::min(width, std::strlen(texts[i])));
  (void)H5Dvlen_reclaim(type, memory, H5P_DEFAULT, texts.data());
}

Handle memory_type(Kind kind, std::size_t width) {
  if (kind == Kind::Integers) return {H5Tcopy(H5T_NATIVE_INT64), H5Tclose, "a type cannot be made"};
  if (kind == Kind::Numbers) return {H5Tcopy(H5T_NATIVE_DOUBLE), H5Tclose, "a type cannot be made"};
  return type_of("S" + std::to_string(width));
}

// HDF5 would copy the bytes twice. These functions, which it calls in place of malloc() and so on, give it the bytes
// themselves each time.
void* same_bytes(size_t size, H5FD_file_image_op_t, void* bytes) noexcept {
  const auto& all = *static_cast<std::span<char>*>(bytes);
  return size <= all.size() ? all.data() : nullptr;
}
void* copy_nothing(void* to, const void*, size_t, H5FD_file_image_op_t, void*) noexcept { return to; }
void* same_size(void*, size_t size, H5FD_file_image_op_t what, void* bytes) noexcept {
  return same_bytes(size, what, bytes);
}
herr_t free_nothing(void*, H5FD_file_image_op_t, void*) noexcept { return 0; }
void* same_user(void* bytes) noexcept { return bytes; }
herr_t free_no_user(void*) noexcept { return 0; }

/// HDF5 may crash when it closes a damaged file. Reading is all that this process does, so it need not.
herr_t close_nothing(hid_t) { return 0; }

hid_t opened(std::span<char>& bytes) {
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "HDF5 cannot be used");
  H5FD_file_image_callbacks_t own{same_bytes, copy_nothing, same_size, free_nothing, same_user, free_no_user, &bytes};
  check(H5Pset_fapl_core(access, std::size_t(1) << 16, false), "HDF5 cannot be used");
  check(H5Pset_file_image_callbacks(access, &own), "HDF5 cannot be used");
  if (bytes.empty() || H5Pset_file_image(access, bytes.data(), bytes.size()) < 0) return -1;
  return H5Fopen("the file", H5F_ACC_RDONLY, access);
}

class File : public formats::Hdf5Source {
 public:
  explicit File(std::span<char> bytes)
      : bytes_(bytes), file_(opened(bytes_), close_nothing, "it is not a whole HDF5 file") {}

  std::vector<formats::Hdf5Item> list(const std::string& path, formats::FileAllowance& allowance) override {
    check_path(file_, path);
    const Handle object(H5Oopen(file_, path.c_str(), H5P_DEFAULT), H5Oclose, "a group cannot be opened");
    Listing listing{{}, allowance};
    hsize_t at = 0;
    if (H5Iget_type(object) == H5I_GROUP) {
      const herr_t members = H5Literate(object, H5_INDEX_NAME, H5_ITER_INC, &at, add_member, &listing);
      if (listing.failure) std::rethrow_exception(listing.failure);
      check(members, "a group cannot be listed");
    }
    at = 0;
    const herr_t attributes = H5Aiterate2(object, H5_INDEX_NAME, H5_ITER_INC, &at, add_attribute, &listing);
    if (listing.failure) std::rethrow_exception(listing.failure);
    check(attributes, "attributes cannot be listed");
    return std::move(listing.items);
  }

  void read(const std::string& path, Kind kind, std::int64_t first, std::span<char> out, std::int64_t count) override {
    const Array array = open(file_, path);
    const Kind own = array.kind();
    if (own != kind && !(own == Kind::Integers && kind == Kind::Numbers))
      throw Refusal("an array is not of the kind that is needed");
    std::vector<hsize_t> dims = array.dims();
    if (dims.empty()) dims = {1};
    if (first < 0 || count < 0 || hsize_t(first) > dims[0] || hsize_t(count) > dims[0] - hsize_t(first))
      throw Refusal("an array has fewer rows than are needed");
    const std::size_t width = kind == Kind::Texts ? array.width() : 8;
    auto values = hsize_t(count);
    for (std::size_t i = 1; i < dims.size(); ++i) {
      if (dims[i] > hsize_t(formats::hdf5::kMostBytes)) throw Refusal("an array has rows that are too long");
      values *= dims[i];
      if (values > hsize_t(formats::hdf5::kMostBytes)) throw Refusal("an array has rows that are too long");
    }
    if (values * width != out.size()) throw Refusal("an array has another size than was said");
    if (values == 0) return;

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
    if (kind == Kind::Texts && H5Tis_variable_str(array.type) > 0)
      return read_fixed_texts(array, memory, selected, out);
    const Handle type = memory_type(kind, width);
    check(array.attribute ? H5Aread(array.object, type, out.data())
                          : H5Dread(array.object, type, memory, selected, H5P_DEFAULT, out.data()),
          "values cannot be read");
  }

 private:
  std::span<char> bytes_;  ///< To which HDF5 refers.
  const Handle file_;
};

}  // namespace

std::unique_ptr<formats::Hdf5Source> open_file(std::span<char> bytes) { return std::make_unique<File>(bytes); }

}  // namespace varimesh::hdf
