// The kernels that keep triangles in registers.
#include "core/device_kernels/cpu/kernels-inl.h"
#include "core/device_kernels/cpu/modules.h"

namespace varimesh::device {

std::span<const CpuKernel> cpu_triangles_2() { return N_ONE_LANE::cpu_kernels<kinds::triangles_2>(); }
std::span<const CpuKernel> cpu_triangles_3() { return N_ONE_LANE::cpu_kernels<kinds::triangles_3>(); }
std::span<const CpuKernel> cpu_triangles_4() { return N_ONE_LANE::cpu_kernels<kinds::triangles_4>(); }
std::span<const CpuKernel> cpu_triangles_5() { return N_ONE_LANE::cpu_kernels<kinds::triangles_5>(); }

}  // namespace varimesh::device
