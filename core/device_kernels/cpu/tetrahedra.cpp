// The kernels that keep tetrahedra in registers.
#include "core/device_kernels/cpu/kernels-inl.h"
#include "core/device_kernels/cpu/modules.h"

namespace varimesh::device {

std::span<const CpuKernel> cpu_tetrahedra_2() { return N_ONE_LANE::cpu_kernels<kinds::tetrahedra_2>(); }
std::span<const CpuKernel> cpu_tetrahedra_3() { return N_ONE_LANE::cpu_kernels<kinds::tetrahedra_3>(); }
std::span<const CpuKernel> cpu_tetrahedra_4() { return N_ONE_LANE::cpu_kernels<kinds::tetrahedra_4>(); }
std::span<const CpuKernel> cpu_tetrahedra_5() { return N_ONE_LANE::cpu_kernels<kinds::tetrahedra_5>(); }

}  // namespace varimesh::device
