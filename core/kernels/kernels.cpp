#include "core/kernels/kernels.h"

namespace varimesh {

std::unique_ptr<Kernels> make_kernels_2d(const Material& material);
std::unique_ptr<Kernels> make_kernels_3d(const Material& material);

std::unique_ptr<Kernels> make_kernels(const Material& material, int dimension) {
  return dimension == 2 ? make_kernels_2d(material) : make_kernels_3d(material);
}

}  // namespace varimesh
