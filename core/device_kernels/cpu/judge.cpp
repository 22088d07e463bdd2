// The kernels that judge cells, as the processor runs them in a device's place.
#include "core/device_kernels/cpu/judge.h"

#include "core/device_kernels/cpu/runs-inl.h"
#include "core/device_kernels/kernels/judge/judge-inl.h"

namespace varimesh::N_ONE_LANE::judge {
namespace {

template <int d>
constexpr device::CpuKernel kKernels[] = {
#define EACH(name, arguments, function) {#name, run_each<device::arguments, function>},
#include "core/device_kernels/kernels/judge/kernels.h"
};

}  // namespace
}  // namespace varimesh::N_ONE_LANE::judge

namespace varimesh::device {

std::span<const CpuKernel> cpu_judge_2d() { return N_ONE_LANE::judge::kKernels<2>; }
std::span<const CpuKernel> cpu_judge_3d() { return N_ONE_LANE::judge::kKernels<3>; }

}  // namespace varimesh::device
