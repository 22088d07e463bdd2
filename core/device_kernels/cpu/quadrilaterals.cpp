// The kernels that keep quadrilaterals in registers.
#include "core/device_kernels/cpu/kernels-inl.h"
#include "core/device_kernels/cpu/modules.h"

namespace varimesh::device {

std::span<const CpuKernel> cpu_quadrilaterals_2() { return N_ONE_LANE::cpu_kernels<kinds::quadrilaterals_2>(); }
std::span<const CpuKernel> cpu_quadrilaterals_3() { return N_ONE_LANE::cpu_kernels<kinds::quadrilaterals_3>(); }
std::span<const CpuKernel> cpu_quadrilaterals_4() { return N_ONE_LANE::cpu_kernels<kinds::quadrilaterals_4>(); }

}  // namespace varimesh::device
