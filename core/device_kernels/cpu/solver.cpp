// The kernels of Newton's method besides those of the cells, as the processor runs them in a device's place.
#include <algorithm>
#include <vector>

#include "core/device_kernels/cpu/modules.h"
#include "core/device_kernels/kernels/coarse-inl.h"
#include "core/device_kernels/kernels/multigrid-inl.h"
#include "core/device_kernels/kernels/vectors-inl.h"

namespace varimesh::N_ONE_LANE {
namespace {

template <class Arguments, auto function>
void run_each(const void* arguments, std::int32_t block, std::int32_t threads) {
  const auto& a = *static_cast<const Arguments*>(arguments);
  for (std::int32_t thread = 0; thread < threads; ++thread)
    function(a, static_cast<std::int64_t>(block) * threads + thread);
}

/// kRowParts threads of a device are one call.
template <auto function>
void run_rows(const void* arguments, std::int32_t block, std::int32_t threads) {
  run_each<device::CoarseArguments, function>(arguments, block, threads / kRowParts);
}

template <class Arguments, auto function, auto member, class Join>
void run_joined(const void* arguments, std::int32_t block, std::int32_t threads) {
  const auto& a = *static_cast<const Arguments*>(arguments);
  std::vector<double> parts(static_cast<std::size_t>(threads));
  for (std::int32_t thread = 0; thread < threads; ++thread)
    parts[static_cast<std::size_t>(thread)] = function(a, static_cast<std::int64_t>(block) * threads + thread);
  for (std::size_t width = parts.size() / 2; width > 0; width /= 2)
    for (std::size_t i = 0; i < width; ++i) parts[i] = Join()(parts[i], parts[i + width]);
  (a.*member)[block] = parts[0];
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
