// The card of the library that takes the place of NVIDIA's driver (fake_driver.cpp), for tests of what works on a card.
// FAKE_DRIVER is the library.
#pragma once

#include <dlfcn.h>

#include <cstdlib>
#include <memory>
#include <string>

#include "core/device/card.h"

namespace varimesh::testing {

/// The card in this state (FAKE_CUDA in fake_driver.cpp), and as if nobody had used it before. No other object may use
/// it.
inline device::Possible<std::unique_ptr<device::Device>> fake_card(const std::string& state) {
  setenv("FAKE_CUDA", state.c_str(), 1);
  using Reset = void(const device::CpuKernel*, std::size_t);
  void* const library = dlopen(FAKE_DRIVER, RTLD_NOW | RTLD_LOCAL);
  reinterpret_cast<Reset*>(dlsym(library, "fake_cuda_kernels"))(nullptr, 0);
  const auto driver = device::Driver::open(FAKE_DRIVER);
  if (!driver) return tl::unexpected(driver.error());
  return driver->use();
}

}  // namespace varimesh::testing
