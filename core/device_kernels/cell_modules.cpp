#include "core/device_kernels/cell_modules.h"

#include <string_view>

#include "core/device_kernels/cpu/judge.h"
#include "core/device_kernels/cpu/modules.h"

#ifdef VARIMESH_CARD_KERNELS
namespace varimesh::device::ptx {
#define KIND(shape, name, order, dimension, columns, layers) extern const std::string_view name##_##order;
#include "core/device_kernels/kernels/cell_kinds.h"
#define ENERGY(dimension, number, name, ...) extern const std::string_view general_##name##_##dimension##d;
#include "core/device_kernels/kernels/energies.h"
extern const std::string_view solver_2d, solver_3d, descent_2d, descent_3d, judge_2d, judge_3d;
}  // namespace varimesh::device::ptx
#define ON_CARD(module) &ptx::module
#else
#define ON_CARD(module) nullptr
#endif

namespace varimesh::device {
namespace {

/// The PTX of a module; null: this build has none.
using Ptx = const std::string_view*;

struct KindRow {
  Shape shape;
  int order;
  CellKind kind;
  std::string_view name;
  std::span<const CpuKernel> (*cpu)();
  Ptx card;
};

const KindRow kKinds[] = {
#define KIND(shape, name, order, dimension, columns, layers)                                                    \
  {Shape::shape,           order, kinds::name##_##order, "of " #name " of order " #order, cpu_##name##_##order, \
   ON_CARD(name##_##order)},
#include "core/device_kernels/kernels/cell_kinds.h"
};

struct EnergyRow {
  int dimension, number;
  Ptx card;
};

const EnergyRow kEnergies[] = {
#define ENERGY(dimension, number, name, ...) {dimension, number, ON_CARD(general_##name##_##dimension##d)},
#include "core/device_kernels/kernels/energies.h"
};

std::span<const unsigned char> packed(Ptx ptx) {
  return ptx == nullptr ? std::span<const unsigned char>()
                        : std::span(reinterpret_cast<const unsigned char*>(ptx->data()), ptx->size());
}

}  // namespace

std::optional<CellModule> cell_kernels(Shape shape, int order, const Material& material) {
  if (material.energy != Energy::Hyperelastic) return std::nullopt;
  for (const KindRow& row : kKinds)
    if (row.shape == shape && row.order == order) return CellModule{row.kind, {row.name, packed(row.card), row.cpu()}};
  return std::nullopt;
}

KernelImage general_kernels(int dimension, const Material& material) {
  const int number = energy_number(dimension, material);
  Ptx card = nullptr;
  for (const EnergyRow& row : kEnergies)
    if (row.dimension == dimension && row.number == number) card = row.card;
  if (dimension == 2) return {"of cells in the plane", packed(card), cpu_general_2d(material)};
  return {"of cells in space", packed(card), cpu_general_3d(material)};
}

KernelImage solver_kernels(int dimension) {
  if (dimension == 2) return {"of Newton's method in the plane", packed(ON_CARD(solver_2d)), cpu_solver_2d()};
  return {"of Newton's method in space", packed(ON_CARD(solver_3d)), cpu_solver_3d()};
}

KernelImage descent_kernels(int dimension) {
  if (dimension == 2) return {"of the descent in the plane", packed(ON_CARD(descent_2d)), cpu_descent_2d()};
  return {"of the descent in space", packed(ON_CARD(descent_3d)), cpu_descent_3d()};
}

KernelImage judge_kernels(int dimension) {
  if (dimension == 2) return {"that judge cells in the plane", packed(ON_CARD(judge_2d)), cpu_judge_2d()};
  return {"that judge cells in space", packed(ON_CARD(judge_3d)), cpu_judge_3d()};
}

}  // namespace varimesh::device
