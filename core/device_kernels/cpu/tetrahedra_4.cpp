#include "core/device_kernels/cpu/kernels-inl.h"
#include "core/device_kernels/cpu/modules.h"

namespace varimesh::device {

std::span<const CpuKernel> cpu_tetrahedra_4(const Material& material) {
  return N_ONE_LANE::cpu_kernels<3, 35>(material);
}

}  // namespace varimesh::device
