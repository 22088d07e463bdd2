// The kernels of the descent besides those of the cells, for a card. clang compiles this file to PTX as card/cells.cpp.
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
#include "core/device_kernels/kernels/solver_arguments.h"

// Everything from here to "end" is compiled for the card too. The headers above are the processor's.
#pragma clang force_cuda_host_device begin
#include "core/device_kernels/card/threads-inl.h"
#include "core/device_kernels/kernels/descent/form-inl.h"
#include "core/device_kernels/kernels/descent/vectors-inl.h"
#pragma clang force_cuda_host_device end

namespace varimesh::N_ONE_LANE {
namespace {
constexpr int d = VARIMESH_DIMENSION;
}

/// Tells this module from others. No kernel reads it.
extern "C" __attribute__((device)) int descent_dimension = VARIMESH_DIMENSION;

// A kernel may not have the name of a function that it calls.
namespace kernels {

#define EACH(name, arguments, function) \
  VARIMESH_KERNEL name(device::arguments a) { N_ONE_LANE::descent::function(a, thread()); }
#define ADD(name, arguments, function, member) \
  VARIMESH_KERNEL name(device::arguments a) { join_block(N_ONE_LANE::descent::function(a, thread()), a.member, Add()); }
#define LARGEST(name, arguments, function, member)                              \
  VARIMESH_KERNEL name(device::arguments a) {                                   \
    join_block(N_ONE_LANE::descent::function(a, thread()), a.member, Larger()); \
  }
#include "core/device_kernels/kernels/descent/kernels.h"

}  // namespace kernels
}  // namespace varimesh::N_ONE_LANE
