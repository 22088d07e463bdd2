#include "core/kernels/hessian/batches.h"

namespace varimesh {

std::unique_ptr<HessianKernels> make_hessian_kernels_2d(const Material& material);
std::unique_ptr<HessianKernels> make_hessian_kernels_3d(const Material& material);

std::unique_ptr<HessianKernels> make_hessian_kernels(const Material& material, int dimension) {
  return dimension == 2 ? make_hessian_kernels_2d(material) : make_hessian_kernels_3d(material);
}

}  // namespace varimesh
