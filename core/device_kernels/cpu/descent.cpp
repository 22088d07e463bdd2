// The kernels of the descent besides those of the cells, as the processor runs them in a device's place.
#include "core/device_kernels/cpu/modules.h"
#include "core/device_kernels/cpu/runs-inl.h"
#include "core/device_kernels/kernels/descent/form-inl.h"
#include "core/device_kernels/kernels/descent/vectors-inl.h"

namespace varimesh::N_ONE_LANE::descent {
namespace {

template <int d>
constexpr device::CpuKernel kKernels[] = {
#define EACH(name, arguments, function) {#name, run_each<device::arguments, function>},
#define ADD(name, arguments, function, member) \
  {#name, run_joined<device::arguments, function, &device::arguments::member, Add>},
#define LARGEST(name, arguments, function, member) \
  {#name, run_joined<device::arguments, function, &device::arguments::member, Larger>},
#include "core/device_kernels/kernels/descent/kernels.h"
};

}  // namespace
}  // namespace varimesh::N_ONE_LANE::descent

namespace varimesh::device {

std::span<const CpuKernel> cpu_descent_2d() { return N_ONE_LANE::descent::kKernels<2>; }
std::span<const CpuKernel> cpu_descent_3d() { return N_ONE_LANE::descent::kKernels<3>; }

}  // namespace varimesh::device
