// The kernels of Newton's method besides those of the cells, as the processor runs them in a device's place.
#include "core/device_kernels/cpu/modules.h"
#include "core/device_kernels/cpu/runs-inl.h"
#include "core/device_kernels/kernels/coarse-inl.h"
#include "core/device_kernels/kernels/multigrid-inl.h"
#include "core/device_kernels/kernels/vectors-inl.h"

namespace varimesh::N_ONE_LANE {
namespace {

/// kRowParts threads of a device are one call.
template <auto function>
void run_rows(const void* arguments, std::int32_t block, std::int32_t threads) {
  run_each<device::CoarseArguments, function>(arguments, block, threads / kRowParts);
}

template <int d>
constexpr device::CpuKernel kSolverKernels[] = {
#define EACH(name, arguments, function) {#name, run_each<device::arguments, function>},
#define EACH_PART(name, arguments, function) {#name, run_rows<function>},
#define ADD(name, arguments, function, member) \
  {#name, run_joined<device::arguments, function, &device::arguments::member, Add>},
#define LARGEST(name, arguments, function, member) \
  {#name, run_joined<device::arguments, function, &device::arguments::member, Larger>},
#include "core/device_kernels/kernels/solver_kernels.h"
};

}  // namespace
}  // namespace varimesh::N_ONE_LANE

namespace varimesh::device {

std::span<const CpuKernel> cpu_solver_2d() { return N_ONE_LANE::kSolverKernels<2>; }
std::span<const CpuKernel> cpu_solver_3d() { return N_ONE_LANE::kSolverKernels<3>; }

}  // namespace varimesh::device
