// What the kernels of every module for cards share: the number of a thread, and sums at nodes. Included inside
// "force_cuda_host_device", after the headers of the kernels.
#pragma once

#include "core/device_kernels/kernels/norm-inl.h"
#include "core/device_kernels/kernels/product-inl.h"

#define VARIMESH_ON_CARD __attribute__((device)) inline __attribute__((always_inline))
#define VARIMESH_KERNEL extern "C" __attribute__((global)) __attribute__((launch_bounds(128, 2))) void

namespace varimesh::N_ONE_LANE {

/// The memory that the threads of a block share.
extern __attribute__((shared)) double shared_numbers[];

VARIMESH_ON_CARD int thread_of_block() { return __nvvm_read_ptx_sreg_tid_x(); }
VARIMESH_ON_CARD int threads_of_block() { return __nvvm_read_ptx_sreg_ntid_x(); }
VARIMESH_ON_CARD std::int64_t thread() {
  return static_cast<std::int64_t>(__nvvm_read_ptx_sreg_ctaid_x()) * threads_of_block() + thread_of_block();
}

/// Joins the numbers of a block's threads in a tree, and writes the result.
template <class Join>
VARIMESH_ON_CARD void join_block(double own, double* parts, const Join& join) {
  shared_numbers[thread_of_block()] = own;
  for (int width = threads_of_block() / 2; width > 0; width /= 2) {
    __syncthreads();
    if (thread_of_block() < width)
      shared_numbers[thread_of_block()] =
          join(shared_numbers[thread_of_block()], shared_numbers[thread_of_block() + width]);
  }
  if (thread_of_block() == 0) parts[__nvvm_read_ptx_sreg_ctaid_x()] = shared_numbers[0];
}

template <int d>
VARIMESH_ON_CARD void add_up_products_of_block(const device::SumArguments& a) {
  join_block(
      add_up_product<d>(a, thread()), a.along,
      [](double one, double two) __attribute__((always_inline)) { return one + two; });
}

}  // namespace varimesh::N_ONE_LANE
