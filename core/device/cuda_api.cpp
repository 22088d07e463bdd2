#include "core/device/cuda_api.h"

#include <dlfcn.h>

namespace varimesh::device::cuda {
namespace {

struct Symbol {
  const char* name;
  void** place;
};

template <class Function>
void** place_of(Function*& function) {
  return reinterpret_cast<void**>(&function);
}

}  // namespace

const char* open_functions(const char* library, Functions& f, bool& is_open) {
  // The library stays open: it has threads of its own and does not expect to be closed.
  void* handle = dlopen(library, RTLD_NOW | RTLD_LOCAL);
  is_open = handle != nullptr;
  if (!is_open) return dlerror();
  const Symbol symbols[] = {
      {"cuInit", place_of(f.init)},
      {"cuDriverGetVersion", place_of(f.driver_version)},
      {"cuGetErrorName", place_of(f.error_name)},
      {"cuDeviceGetCount", place_of(f.device_count)},
      {"cuDeviceGet", place_of(f.device)},
      {"cuDeviceGetName", place_of(f.device_name)},
      {"cuDeviceGetAttribute", place_of(f.device_attribute)},
      {"cuDeviceTotalMem_v2", place_of(f.device_memory)},
      {"cuDevicePrimaryCtxRetain", place_of(f.retain_context)},
      {"cuDevicePrimaryCtxRelease_v2", place_of(f.release_context)},
      {"cuCtxSetCurrent", place_of(f.set_context)},
      {"cuMemGetInfo_v2", place_of(f.free_memory)},
      {"cuCtxSynchronize", place_of(f.wait)},
      {"cuModuleLoadDataEx", place_of(f.load_module)},
      {"cuModuleUnload", place_of(f.unload_module)},
      {"cuModuleGetFunction", place_of(f.module_function)},
      {"cuFuncSetAttribute", place_of(f.set_function_attribute)},
      {"cuMemAlloc_v2", place_of(f.allocate)},
      {"cuMemFree_v2", place_of(f.free)},
      {"cuMemcpyHtoD_v2", place_of(f.to_device)},
      {"cuMemcpyDtoH_v2", place_of(f.from_device)},
      {"cuLaunchKernel", place_of(f.launch)},
  };
  for (const Symbol& symbol : symbols) {
    *symbol.place = dlsym(handle, symbol.name);
    if (*symbol.place == nullptr) return symbol.name;
  }
  return nullptr;
}

}  // namespace varimesh::device::cuda
