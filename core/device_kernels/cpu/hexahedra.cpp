// The kernels that keep hexahedra in registers.
#include "core/device_kernels/cpu/kernels-inl.h"
#include "core/device_kernels/cpu/modules.h"

namespace varimesh::device {

std::span<const CpuKernel> cpu_hexahedra_2() { return N_ONE_LANE::cpu_kernels<kinds::hexahedra_2>(); }
std::span<const CpuKernel> cpu_hexahedra_3() { return N_ONE_LANE::cpu_kernels<kinds::hexahedra_3>(); }
std::span<const CpuKernel> cpu_hexahedra_4() { return N_ONE_LANE::cpu_kernels<kinds::hexahedra_4>(); }

}  // namespace varimesh::device
