// The table of energies: every energy is one file and one case in with_energy().
#if defined(VARIMESH_ENERGY_TABLE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef VARIMESH_ENERGY_TABLE_INL_H
#undef VARIMESH_ENERGY_TABLE_INL_H
#else
#define VARIMESH_ENERGY_TABLE_INL_H
#endif

#include "core/energy/distortion-inl.h"
#include "core/energy/hyperelastic-inl.h"
#include "core/energy/linear_elastic-inl.h"
#include "core/energy/material.h"
#include "core/energy/winslow-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh {
namespace HWY_NAMESPACE {

/// Calls use(energy) with an object of the type of the material's energy. The kernels are compiled for each type,
/// because a switch inside a kernel would prevent the vectorised logarithm and make it 5.7 times slower.
template <int d, class Use>
auto with_energy(const Material& m, Use use) {
  using enum Strain;
  const bool small = m.strain == Small;
  const bool trace = m.volumetric == Volumetric::Trace;
  switch (m.energy) {
    case Energy::LinearElastic:
      if (small && trace) return use(LinearElasticEnergy<d, Small, Volumetric::Trace>(m));
      if (small) return use(LinearElasticEnergy<d, Small, Volumetric::Log>(m));
      if (trace) return use(LinearElasticEnergy<d, GreenLagrange, Volumetric::Trace>(m));
      return use(LinearElasticEnergy<d, GreenLagrange, Volumetric::Log>(m));
    case Energy::Winslow:
      if (d == 3 && m.winslow == Winslow::True) return use(WinslowEnergy<d, Winslow::True>(m));
      return use(WinslowEnergy<d, Winslow::Paper>(m));
    case Energy::Distortion:
      return use(DistortionEnergy<d>(m));
    case Energy::Hyperelastic:
      break;
  }
  return use(HyperelasticEnergy<d>(m));
}

}  // namespace HWY_NAMESPACE
}  // namespace varimesh
HWY_AFTER_NAMESPACE();

#endif
