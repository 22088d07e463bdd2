// The kernels of cells of any shape and order, and of one energy, for a card. clang compiles this file to PTX as
// card/cells.cpp. It defines
//   VARIMESH_DIMENSION       2 or 3
//   VARIMESH_ENERGY          the type of the energy
//   VARIMESH_ENERGY_NUMBER   its number in kernels/energies.h
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <type_traits>
#include <utility>

#include "core/device_kernels/kernels/arguments.h"

// Everything from here to "end" is compiled for the card too. The headers above are the processor's.
#pragma clang force_cuda_host_device begin
#include "core/device_kernels/card/threads-inl.h"
#include "core/device_kernels/kernels/linearised-inl.h"
#include "core/energy/table-inl.h"
#pragma clang force_cuda_host_device end

namespace varimesh::N_ONE_LANE {
namespace {

constexpr int d = VARIMESH_DIMENSION;
using Thread = LinearisedThread<VARIMESH_ENERGY, d>;
using device::GeneralArguments;

template <class Work>
VARIMESH_ON_CARD void run(const GeneralArguments& a, int per_batch, const Work& work) {
  const Thread thread_of_cell(a, thread(), per_batch);
  if (thread_of_cell.exists()) work(thread_of_cell);
}

}  // namespace

/// Tell this module from others. No kernel reads them.
extern "C" __attribute__((device)) int any_cells = VARIMESH_DIMENSION;
extern "C" __attribute__((device)) int energy_number = VARIMESH_ENERGY_NUMBER;

#define KERNEL(name, per_batch, call)                                                      \
  VARIMESH_KERNEL name(GeneralArguments a) {                                               \
    run(                                                                                   \
        a, per_batch, [](const Thread& own) __attribute__((always_inline)) { own.call; }); \
  }
KERNEL(deform, a.points, deform())
KERNEL(scan, 1, scan())
KERNEL(range, 1, range())
KERNEL(stress, a.points, stress<false>())
KERNEL(linearise, a.points, stress<true>())
KERNEL(gradient, a.nodes, gradient())
KERNEL(change_stress, a.points, change_stress())
KERNEL(product, a.nodes, product())
KERNEL(node_block, a.nodes, node_block())
KERNEL(mean_tensor, 1, mean_tensor())
KERNEL(keep_convex_part, a.points, keep_convex_part())

}  // namespace varimesh::N_ONE_LANE

#include "core/device_kernels/card/sums-inl.h"
