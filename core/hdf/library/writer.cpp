#include "core/hdf/library/writer.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <system_error>
#include <utility>

#include "core/base/io/write_all.h"
#include "core/hdf/library/types.h"

namespace varimesh::hdf {

namespace {

using Dims = std::span<const std::int64_t>;

constexpr const char* kNotReadBack = "the file cannot be read back";

int nameless_file() {
  std::error_code none;
  const std::filesystem::path folder = std::filesystem::temp_directory_path(none);
  const int file = none ? -1 : ::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  return file >= 0 ? file : ::memfd_create("varimesh hdf5", MFD_CLOEXEC);
}

std::size_t values_of(Dims dims) {
  std::size_t count = 1;
  for (const std::int64_t n : dims) count *= std::size_t(n);
  return count;
}

Handle space_of(Dims dims) {
  const std::vector<hsize_t> extent(dims.begin(), dims.end());
  return {extent.empty() ? H5Screate(H5S_SCALAR) : H5Screate_simple(int(extent.size()), extent.data(), nullptr),
          H5Sclose, "an extent cannot be made"};
}

void check_size(std::string_view values, Dims dims, hid_t type) {
  if (values.size() != values_of(dims) * H5Tget_size(type)) throw Refusal("an array has another size than its values");
}

Handle made_array(hid_t file, const std::string& path, hid_t type, Dims dims) {
  // Without the time, the same mesh gives the same bytes.
  const Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, "an array cannot be made");
  check(H5Pset_obj_track_times(properties, false), "an array cannot be made");
  // rows() writes the values, so they get their place now, and no other values.
  check(H5Pset_layout(properties, H5D_CONTIGUOUS), "an array cannot be made");
  check(H5Pset_alloc_time(properties, H5D_ALLOC_TIME_EARLY), "an array cannot be made");
  check(H5Pset_fill_time(properties, H5D_FILL_TIME_NEVER), "an array cannot be made");
  return {H5Dcreate2(file, path.c_str(), type, space_of(dims), H5P_DEFAULT, properties, H5P_DEFAULT), H5Dclose,
          "an array cannot be made"};
}

}  // namespace

Writer::Writer() : descriptor_(nameless_file()) {
  if (descriptor_ < 0) throw Refusal("the file cannot be made");
  // The driver that HDF5 uses otherwise looks for the file by its name, and this file has none.
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "HDF5 cannot be used");
  check(H5Pset_fapl_stdio(access), "HDF5 cannot be used");
  const Handle made(H5Pcreate(H5P_FILE_CREATE), H5Pclose, "the file cannot be made");
  check(H5Pset_link_creation_order(made, H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED), "the file cannot be made");
  file_ = H5Fcreate(("/proc/self/fd/" + std::to_string(descriptor_)).c_str(), H5F_ACC_TRUNC, made, access);
  if (file_ < 0) throw Refusal("the file cannot be made");
}

Writer::~Writer() {
  if (file_ >= 0) H5Fclose(file_);
  ::close(descriptor_);
}

void Writer::group(const std::string& path) {
  const Handle made(H5Pcreate(H5P_GROUP_CREATE), H5Pclose, "a group cannot be made");
  check(H5Pset_obj_track_times(made, false), "a group cannot be made");
  check(H5Pset_link_creation_order(made, H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED), "a group cannot be made");
  const Handle group(H5Gcreate2(file_, path.c_str(), H5P_DEFAULT, made, H5P_DEFAULT), H5Gclose,
                     "a group cannot be made");
}

void Writer::array(const std::string& path, std::string_view type_name, Dims dims, std::string_view values) {
  const Handle type = type_of(type_name);
  check_size(values, dims, type);
  const Handle made = made_array(file_, path, type, dims);
  if (!values.empty())
    check(H5Dwrite(made, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), "an array cannot be written");
}

void Writer::attribute(const std::string& owner, const std::string& name, std::string_view type_name, Dims dims,
                       std::string_view values) {
  const Handle type = type_of(type_name);
  check_size(values, dims, type);
  const Handle made(H5Acreate_by_name(file_, owner.c_str(), name.c_str(), type, space_of(dims), H5P_DEFAULT,
                                      H5P_DEFAULT, H5P_DEFAULT),
                    H5Aclose, "an attribute cannot be made");
  check(H5Awrite(made, type, values.data()), "an attribute cannot be written");
}

void Writer::array(const std::string& path, std::string_view type, Dims dims) {
  const haddr_t begin = H5Dget_offset(made_array(file_, path, type_of(type), dims));
  if (begin != HADDR_UNDEF) places_[path] = std::int64_t(begin);
}

void Writer::rows(const std::string& path, std::int64_t first, std::int64_t count, std::string_view values) {
  if (count == 0) return;
  const auto found = places_.find(path);
  if (found == places_.end()) throw Refusal("rows cannot be written");
  // HDF5 would only put the values there, from one thread.
  const auto row = std::int64_t(values.size()) / count;
  if (!write_all_at(descriptor_, values, off_t(found->second + first * row)))
    throw Refusal("there is no room for it in the folder for temporary files; name another one with TMPDIR");
}

std::int64_t Writer::finish() {
  check(H5Fclose(std::exchange(file_, -1)), "the file cannot be ended; the disk may be full");
  struct stat status {};
  if (::fstat(descriptor_, &status) != 0) throw Refusal(kNotReadBack);
  return status.st_size;
}

void Writer::send(std::int64_t size, formats::hdf5::Outgoing& to) const {
  std::vector<char> piece(std::size_t(1) << 18);
  for (std::int64_t at = 0; at < size;) {
    const ssize_t n = ::pread(descriptor_, piece.data(), piece.size(), at);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) throw Refusal(kNotReadBack);
    to.put({piece.data(), std::size_t(n)});
    at += n;
  }
  to.flush();
}

}  // namespace varimesh::hdf
