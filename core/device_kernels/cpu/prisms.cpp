// The kernels that keep prisms in registers.
#include "core/device_kernels/cpu/kernels-inl.h"
#include "core/device_kernels/cpu/modules.h"

namespace varimesh::device {

std::span<const CpuKernel> cpu_prisms_2() { return N_ONE_LANE::cpu_kernels<kinds::prisms_2>(); }
std::span<const CpuKernel> cpu_prisms_3() { return N_ONE_LANE::cpu_kernels<kinds::prisms_3>(); }
std::span<const CpuKernel> cpu_prisms_4() { return N_ONE_LANE::cpu_kernels<kinds::prisms_4>(); }

}  // namespace varimesh::device
