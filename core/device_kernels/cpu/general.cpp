#include "core/device_kernels/cpu/kernels-inl.h"
#include "core/device_kernels/cpu/modules.h"

namespace varimesh::device {

std::span<const CpuKernel> cpu_general_2d(const Material& material) {
  return N_ONE_LANE::general_cpu_kernels<2>(material);
}

std::span<const CpuKernel> cpu_general_3d(const Material& material) {
  return N_ONE_LANE::general_cpu_kernels<3>(material);
}

}  // namespace varimesh::device
