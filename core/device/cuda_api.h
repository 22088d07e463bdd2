// The part of NVIDIA's driver interface that VariMesh calls: types, numbers and functions of libcuda.so.1. They are
// declared here, so that no toolkit is needed to build, and the library is opened when a device is asked for.
//
// Reference: CUDA Driver API, https://docs.nvidia.com/cuda/cuda-driver-api. The interface is stable: functions that
// changed have a new name with _v2.
#pragma once

#include <cstddef>
#include <cstdint>

namespace varimesh::device::cuda {

using Result = int;
using Ordinal = int;
using Address = std::uint64_t;
using Context = struct OpaqueContext*;
using Module = struct OpaqueModule*;
using Function = struct OpaqueFunction*;
using Stream = struct OpaqueStream*;

/// Results that get a sentence of their own. All others are reported with the driver's name for them.
enum : Result {
  kSuccess = 0,
  kOutOfMemory = 2,
  kDeviceUnavailable = 46,  ///< Another process has the device for itself.
  kNoDevice = 100,
  kInvalidImage = 200,
  kNoBinaryForDevice = 209,
  kInvalidPtx = 218,
  kUnsupportedPtxVersion = 222,
  kTooManyResources = 701,  ///< A launch takes more registers or shared memory than a block may have.
  kSystemDriverMismatch = 803,
};

/// Attributes of a device.
enum : int {
  kMultiprocessors = 16,
  kCapabilityMajor = 75,
  kCapabilityMinor = 76,
  kMostSharedMemoryPerBlock = 97,
};

/// The attribute of a function that allows it more than 48 KiB of shared memory.
inline constexpr int kMostDynamicSharedMemory = 8;

/// Options of loading a module: where the compiler writes what it has to say.
enum : int { kErrorLog = 5, kErrorLogBytes = 6 };

/// The functions by name. Where the interface has a second version of one, it is the second.
struct Functions {
  Result (*init)(unsigned flags);
  Result (*driver_version)(int* version);
  Result (*error_name)(Result, const char** name);
  Result (*device_count)(int* count);
  Result (*device)(Ordinal* device, int number);
  Result (*device_name)(char* name, int room, Ordinal);
  Result (*device_attribute)(int* value, int attribute, Ordinal);
  Result (*device_memory)(std::size_t* bytes, Ordinal);
  Result (*retain_context)(Context*, Ordinal);
  Result (*release_context)(Ordinal);
  Result (*set_context)(Context);
  Result (*free_memory)(std::size_t* free, std::size_t* total);
  Result (*wait)();
  Result (*load_module)(Module*, const void* image, unsigned options, int* names, void** values);
  Result (*unload_module)(Module);
  Result (*module_function)(Function*, Module, const char* name);
  Result (*set_function_attribute)(Function, int attribute, int value);
  Result (*allocate)(Address*, std::size_t bytes);
  Result (*free)(Address);
  Result (*to_device)(Address, const void*, std::size_t bytes);
  Result (*from_device)(void*, Address, std::size_t bytes);
  Result (*launch)(Function, unsigned grid_x, unsigned grid_y, unsigned grid_z, unsigned block_x, unsigned block_y,
                   unsigned block_z, unsigned shared_bytes, Stream, void** arguments, void** extra);
};

/// Opens the library and finds the functions. Returns null if all were found, else what is missing: the library
/// (dlerror's text) or a function.
///
/// @param library  a file name, or a path
/// @param is_open  receives whether there is such a library
const char* open_functions(const char* library, Functions& functions, bool& is_open);

}  // namespace varimesh::device::cuda
