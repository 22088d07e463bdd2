#include "core/hdf/remote_file.h"

#if __has_include(<H5FDdevelop.h>)
#include <H5FDdevelop.h>
#endif

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "core/hdf/socket.h"
#include "core/hdf/types.h"

namespace varimesh::hdf {

namespace {

using formats::hdf5::Answer;
using formats::hdf5::AnswerHead;

constexpr std::size_t kBlock = std::size_t(1) << 14;
constexpr std::size_t kBlocks = 64;

/// The file. HDF5 reads its tables in small pieces, so blocks are kept that are fetched at once.
struct Remote {
  H5FD_t common{};  ///< HDF5's own part must come first.
  haddr_t end_of_space = 0;
  haddr_t size = 0;
  std::array<haddr_t, kBlocks> kept{};  ///< Which block each place has, counted from 1.
  std::vector<char> blocks = std::vector<char>(kBlock * kBlocks);

  bool fetch(haddr_t at, std::size_t bytes, char* to) const {
    const AnswerHead need{Answer::Need, std::int64_t(bytes), std::int64_t(at)};
    return send(&need, sizeof need) && receive(to, bytes);
  }

  bool read(haddr_t at, std::size_t bytes, char* to) {
    if (bytes >= 2 * kBlock) return fetch(at, bytes, to);
    while (bytes > 0) {
      const haddr_t block = at / kBlock, begin = block * kBlock;
      char* const own = blocks.data() + block % kBlocks * kBlock;
      if (haddr_t& is = kept[block % kBlocks]; is != block + 1) {
        is = 0;
        if (!fetch(begin, std::size_t(std::min<haddr_t>(kBlock, size - begin)), own)) return false;
        is = block + 1;
      }
      const std::size_t part = std::min(bytes, kBlock - std::size_t(at - begin));
      std::memcpy(to, own + (at - begin), part);
      at += part;
      to += part;
      bytes -= part;
    }
    return true;
  }
};

Remote* waiting = nullptr;  // the file that the next call of open() opens

Remote& remote(H5FD_t* file) { return *reinterpret_cast<Remote*>(file); }
const Remote& remote(const H5FD_t* file) { return *reinterpret_cast<const Remote*>(file); }

H5FD_t* open(const char*, unsigned, hid_t, haddr_t) noexcept {
  return waiting == nullptr ? nullptr : &std::exchange(waiting, nullptr)->common;
}
herr_t close(H5FD_t* file) noexcept {
  delete &remote(file);
  return 0;
}
haddr_t end_of_space(const H5FD_t* file, H5FD_mem_t) noexcept { return remote(file).end_of_space; }
herr_t set_end_of_space(H5FD_t* file, H5FD_mem_t, haddr_t to) noexcept {
  remote(file).end_of_space = to;
  return 0;
}
haddr_t end_of_file(const H5FD_t* file, H5FD_mem_t) noexcept { return remote(file).size; }

herr_t read(H5FD_t* file, H5FD_mem_t, hid_t, haddr_t at, size_t bytes, void* to) noexcept {
  Remote& own = remote(file);
  // As with HDF5's own drivers, bytes behind the end are zero.
  const std::size_t there = at < own.size ? std::size_t(std::min<haddr_t>(bytes, own.size - at)) : 0;
  std::memset(static_cast<char*>(to) + there, 0, bytes - there);
  return own.read(at, there, static_cast<char*>(to)) ? 0 : -1;
}

herr_t refuse_write(H5FD_t*, H5FD_mem_t, hid_t, haddr_t, size_t, const void*) noexcept { return -1; }

H5FD_class_t driver() {
  H5FD_class_t all{};
#ifdef H5FD_CLASS_VERSION  // since HDF5 1.14
  all.version = H5FD_CLASS_VERSION;
  all.value = H5FD_class_value_t(600);  // the first that programs may choose
#endif
  all.name = "remote";
  all.maxaddr = haddr_t(INT64_MAX);
  all.fc_degree = H5F_CLOSE_WEAK;
  all.open = open;
  all.close = close;
  all.get_eoa = end_of_space;
  all.set_eoa = set_end_of_space;
  all.get_eof = end_of_file;
  all.read = read;
  all.write = refuse_write;
  return all;
}

}  // namespace

hid_t open_remote(std::int64_t bytes) {
  static const H5FD_class_t own = driver();
  static const hid_t id = H5FDregister(&own);
  const Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "HDF5 cannot be used");
  check(id < 0 ? -1 : H5Pset_driver(access, id, nullptr), "HDF5 cannot be used");
  waiting = new Remote;
  waiting->size = haddr_t(std::max<std::int64_t>(0, bytes));
  const hid_t file = H5Fopen("the file", H5F_ACC_RDONLY, access);
  delete std::exchange(waiting, nullptr);  // if HDF5 did not come that far
  return file;
}

}  // namespace varimesh::hdf
