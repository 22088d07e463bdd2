// The kernels that judge cells, for a card. clang compiles this file to PTX as card/cells.cpp.
// It defines
//   VARIMESH_DIMENSION   2 or 3
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <type_traits>
#include <utility>

#include "core/device_kernels/kernels/arguments.h"
#include "core/device_kernels/kernels/descent/arguments.h"
#include "core/device_kernels/kernels/judge/arguments.h"
#include "core/device_kernels/kernels/solver_arguments.h"

// Everything from here to "end" is compiled for the card too. The headers above are the processor's.
#pragma clang force_cuda_host_device begin
#include "core/device_kernels/card/threads-inl.h"
#include "core/device_kernels/kernels/judge/judge-inl.h"
#pragma clang force_cuda_host_device end

namespace varimesh::N_ONE_LANE {
namespace {
constexpr int d = VARIMESH_DIMENSION;
}

/// Tells this module from others. No kernel reads it.
extern "C" __attribute__((device)) int judge_dimension = VARIMESH_DIMENSION;

// A kernel may not have the name of a function that it calls.
namespace kernels {

#define EACH(name, arguments, function) \
  VARIMESH_KERNEL name(device::arguments a) { N_ONE_LANE::judge::function(a, thread()); }
#include "core/device_kernels/kernels/judge/kernels.h"

}  // namespace kernels
}  // namespace varimesh::N_ONE_LANE
