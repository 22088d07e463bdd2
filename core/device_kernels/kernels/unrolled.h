// Before a loop over an array that has to stay in registers on a device, and before a loop whose steps already need all
// registers. On the processor both are loops like any other.
#pragma once

#ifdef __CUDA_ARCH__
#define VARIMESH_UNROLLED _Pragma("unroll")
#define VARIMESH_NOT_UNROLLED _Pragma("unroll 1")
#else
#define VARIMESH_UNROLLED
#define VARIMESH_NOT_UNROLLED
#endif
