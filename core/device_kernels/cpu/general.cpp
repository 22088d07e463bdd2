#include "core/device_kernels/cpu/kernels-inl.h"
#include "core/device_kernels/cpu/modules.h"

namespace varimesh::N_ONE_LANE {
namespace {

/// By type of an energy: its number in kernels/energies.h.
template <class E>
constexpr int kEnergyNumber = 0;
#define ENERGY(dimension, number, name, ...) \
  template <>                                \
  constexpr int kEnergyNumber<__VA_ARGS__> = number;
#include "core/device_kernels/kernels/energies.h"

template <int d>
int energy_number(const Material& material) {
  return with_energy<d>(material, [](const auto& energy) {
    using E = std::decay_t<decltype(energy)>;
    // with_energy() never chooses the true Winslow energy in two dimensions, where the paper's is the same.
    constexpr bool is_chosen = d == 3 || !std::is_same_v<E, WinslowEnergy<d, Winslow::True>>;
    static_assert(kEnergyNumber<E> > 0 || !is_chosen, "kernels/energies.h lists every energy");
    return kEnergyNumber<E>;
  });
}

}  // namespace
}  // namespace varimesh::N_ONE_LANE

namespace varimesh::device {

std::span<const CpuKernel> cpu_general_2d(const Material& material) {
  return N_ONE_LANE::general_cpu_kernels<2>(material);
}

std::span<const CpuKernel> cpu_general_3d(const Material& material) {
  return N_ONE_LANE::general_cpu_kernels<3>(material);
}

int energy_number(int dimension, const Material& material) {
  return dimension == 2 ? N_ONE_LANE::energy_number<2>(material) : N_ONE_LANE::energy_number<3>(material);
}

}  // namespace varimesh::device
