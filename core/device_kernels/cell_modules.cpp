#include "core/device_kernels/cell_modules.h"

#include <string_view>

#include "core/device_kernels/cpu/modules.h"

#ifdef VARIMESH_CARD_KERNELS
namespace varimesh::device::ptx {
extern const std::string_view tetrahedra_2, tetrahedra_3, tetrahedra_4, tetrahedra_5, general_2d, general_3d, solver_2d,
    solver_3d;
}
#endif

namespace varimesh::device {
namespace {

struct Row {
  Shape shape;
  int order;
  std::string_view name;
  std::span<const CpuKernel> (*cpu)(const Material&);
  const std::string_view* card;  ///< For the hyperelastic energy; null: this build has none.
};

#ifdef VARIMESH_CARD_KERNELS
#define ON_CARD(module) &ptx::module
#else
#define ON_CARD(module) nullptr
#endif

const Row kRows[] = {
    {Shape::Tetrahedron, 2, "of tetrahedra of order 2", cpu_tetrahedra_2, ON_CARD(tetrahedra_2)},
    {Shape::Tetrahedron, 3, "of tetrahedra of order 3", cpu_tetrahedra_3, ON_CARD(tetrahedra_3)},
    {Shape::Tetrahedron, 4, "of tetrahedra of order 4", cpu_tetrahedra_4, ON_CARD(tetrahedra_4)},
    {Shape::Tetrahedron, 5, "of tetrahedra of order 5", cpu_tetrahedra_5, ON_CARD(tetrahedra_5)},
};

/// For all other cells, by dimension.
const Row kGeneral[] = {
    {Shape::Point, 0, "of cells in the plane", cpu_general_2d, ON_CARD(general_2d)},
    {Shape::Point, 0, "of cells in space", cpu_general_3d, ON_CARD(general_3d)},
};

std::span<const unsigned char> packed(const std::string_view* ptx) {
  return ptx == nullptr ? std::span<const unsigned char>()
                        : std::span(reinterpret_cast<const unsigned char*>(ptx->data()), ptx->size());
}

KernelImage image_of(const Row& row, const Material& material) {
  KernelImage image{row.name, {}, row.cpu(material)};
  if (material.energy == Energy::Hyperelastic) image.packed = packed(row.card);
  return image;
}

}  // namespace

std::optional<KernelImage> cell_kernels(Shape shape, int order, const Material& material) {
  for (const Row& row : kRows)
    if (row.shape == shape && row.order == order) return image_of(row, material);
  return std::nullopt;
}

KernelImage general_kernels(int dimension, const Material& material) {
  return image_of(kGeneral[dimension - 2], material);
}

KernelImage solver_kernels(int dimension) {
  if (dimension == 2) return {"of Newton's method in the plane", packed(ON_CARD(solver_2d)), cpu_solver_2d()};
  return {"of Newton's method in space", packed(ON_CARD(solver_3d)), cpu_solver_3d()};
}

}  // namespace varimesh::device
