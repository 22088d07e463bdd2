// Products with the Hessian in 2-D, compiled once for each instruction set.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/kernels/hessian/hessian_2d.cpp"
#include <hwy/foreach_target.h>
// Highway needs these includes after foreach_target.h.
#include <hwy/highway.h>

#include "core/kernels/hessian/hessian-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

HessianKernels* new_hessian_kernels_2d(const Material& material) { return new_hessian_kernels<2>(material); }

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace varimesh {

HWY_EXPORT(new_hessian_kernels_2d);

std::unique_ptr<HessianKernels> make_hessian_kernels_2d(const Material& material) {
  return std::unique_ptr<HessianKernels>(HWY_DYNAMIC_DISPATCH(new_hessian_kernels_2d)(material));
}

}  // namespace varimesh
#endif
