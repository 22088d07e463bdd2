#include "core/hdf/write.h"

#include <sstream>
#include <vector>

#include "core/hdf/types.h"

namespace varimesh::hdf {

namespace {

/// The number of values in an extent.
std::size_t values_of(const std::vector<hsize_t>& dims) {
  std::size_t count = 1;
  for (const hsize_t n : dims) count *= n;
  return count;
}

Handle space_of(const std::vector<hsize_t>& dims) {
  return {dims.empty() ? H5Screate(H5S_SCALAR) : H5Screate_simple(int(dims.size()), dims.data(), nullptr), H5Sclose,
          "an extent cannot be made"};
}

}  // namespace

hid_t make_file(const char* path, hid_t access) {
  const Handle made(H5Pcreate(H5P_FILE_CREATE), H5Pclose, "the file cannot be made");
  check(H5Pset_link_creation_order(made, H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED), "the file cannot be made");
  return H5Fcreate(path, H5F_ACC_TRUNC, made, access);
}

void make_group(hid_t file, const std::string& path) {
  const Handle made(H5Pcreate(H5P_GROUP_CREATE), H5Pclose, "a group cannot be made");
  check(H5Pset_obj_track_times(made, false), "a group cannot be made");
  check(H5Pset_link_creation_order(made, H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED), "a group cannot be made");
  const Handle group(H5Gcreate2(file, path.c_str(), H5P_DEFAULT, made, H5P_DEFAULT), H5Gclose,
                     "a group cannot be made");
}

std::string make_array(hid_t file, const std::string& text, bool attribute, std::string_view values) {
  std::istringstream lines(text);
  std::string owner, name, type_name, extent;
  std::getline(lines, owner);
  if (attribute) std::getline(lines, name);
  std::getline(lines, type_name);
  std::getline(lines, extent);
  std::vector<hsize_t> dims;
  std::istringstream numbers(extent);
  for (hsize_t n = 0; numbers >> n;) dims.push_back(n);

  const Handle type = type_of(type_name), space = space_of(dims);
  if (!values.empty() && values.size() != values_of(dims) * H5Tget_size(type))
    throw Refusal("an array has another size than its values");
  if (attribute) {
    const Handle made(
        H5Acreate_by_name(file, owner.c_str(), name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
        H5Aclose, "an attribute cannot be made");
    check(H5Awrite(made, type, values.data()), "an attribute cannot be written");
    return {};
  }
  // Without the time, the same mesh gives the same bytes.
  const Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, "an array cannot be made");
  check(H5Pset_obj_track_times(properties, false), "an array cannot be made");
  // Whoever asked may write the values, so they get their place now, and no other values.
  check(H5Pset_layout(properties, H5D_CONTIGUOUS), "an array cannot be made");
  check(H5Pset_alloc_time(properties, H5D_ALLOC_TIME_EARLY), "an array cannot be made");
  check(H5Pset_fill_time(properties, H5D_FILL_TIME_NEVER), "an array cannot be made");
  const Handle made(H5Dcreate2(file, owner.c_str(), type, space, H5P_DEFAULT, properties, H5P_DEFAULT), H5Dclose,
                    "an array cannot be made");
  if (!values.empty()) {
    check(H5Dwrite(made, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), "an array cannot be written");
    return {};
  }
  const haddr_t begin = H5Dget_offset(made);
  return begin == HADDR_UNDEF ? "" : std::to_string(begin);
}

void write_rows(hid_t file, const std::string& path, std::int64_t first, std::int64_t count, std::string_view values) {
  const Handle array(H5Dopen2(file, path.c_str(), H5P_DEFAULT), H5Dclose, "an array cannot be opened");
  const Handle type(H5Dget_type(array), H5Tclose, "an array has no type");
  const Handle space(H5Dget_space(array), H5Sclose, "an array has no extent");
  const int rank = H5Sget_simple_extent_ndims(space);
  if (rank < 1 || first < 0 || count < 1) throw Refusal("rows cannot be selected");
  std::vector<hsize_t> much(std::size_t(rank), 0), from(std::size_t(rank), 0);
  check(H5Sget_simple_extent_dims(space, much.data(), nullptr), "an array has no extent");
  from[0] = hsize_t(first);
  much[0] = hsize_t(count);
  check(H5Sselect_hyperslab(space, H5S_SELECT_SET, from.data(), nullptr, much.data(), nullptr),
        "rows cannot be selected");
  const hsize_t all = values_of(much);
  if (values.size() != all * H5Tget_size(type)) throw Refusal("rows have another size than their values");
  const Handle memory(H5Screate_simple(1, &all, nullptr), H5Sclose, "there is too little memory");
  check(H5Dwrite(array, type, memory, space, H5P_DEFAULT, values.data()), "rows cannot be written");
}

}  // namespace varimesh::hdf
