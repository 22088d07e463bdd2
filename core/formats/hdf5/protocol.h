// How the library talks to varimesh_hdf5, the program that reads and writes HDF5 files (core/hdf). Internal to
// core/formats/hdf5 and core/hdf.
//
// The library starts one process for each file. It sends an order and then the bytes of the file that is to be read, or
// the mesh that is to be written (mesh_bytes.h). The program sends one answer and then what was asked for: the mesh, or
// the bytes of the file.
#pragma once

#include <cstdint>
#include <type_traits>

#include "core/formats/common/format.h"

namespace varimesh::formats::hdf5 {

/// The program, which lies beside the command or in lib/varimesh.
inline constexpr const char* kProgram = "varimesh_hdf5";
/// The program's socket.
inline constexpr int kSocket = 3;
/// Changes with every change of what is sent: the program may come from another package than the library.
inline constexpr std::uint32_t kVersion = 2;

struct Order {
  std::uint32_t version = kVersion;
  std::int32_t threads = 1;  ///< That write.
  Format format{};           ///< That is written. Auto: a file is read.
  std::int64_t bytes = 0;    ///< Of the file that is read.
};

enum class Outcome : std::int32_t {
  Done,     ///< The mesh or the `bytes` bytes of the file follow.
  Refused,  ///< A whole sentence of `bytes` bytes follows: the file, or what is asked for, cannot be done.
  Failed,   ///< The reason, a part of a sentence of `bytes` bytes, follows: HDF5 or the system failed.
};

struct Answer {
  Outcome outcome{};
  Format format{};  ///< That was read.
  std::int64_t bytes = 0;
};

/// The most bytes of a sentence.
inline constexpr std::int64_t kMostSentence = 1 << 12;

static_assert(std::is_trivially_copyable_v<Order> && std::is_trivially_copyable_v<Answer>);

}  // namespace varimesh::formats::hdf5
