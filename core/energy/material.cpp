// The constants of a material, and what its energy's type says about it.
#include "core/energy/material.h"

#include "core/energy/table-inl.h"
#include "core/options/option_table.h"

namespace varimesh {

Material material(const Options& options) {
  Material m;
  m.energy = options.energy;
  m.strain = options.strain;
  m.volumetric = options.volumetric;
  m.winslow = options.winslow;
  m.mu = options.mu > 0 ? options.mu : kReferenceMu;
  const bool standard = options.constants == Constants::Standard && options.energy == Energy::Hyperelastic;
  m.lambda = options.lambda > 0 ? options.lambda : standard ? kStandardLambda : kReferenceBulk;
  m.kappa = options.kappa > 0 ? options.kappa : kReferenceBulk;
  return m;
}

bool has_barrier(const Material& material) {
  return HWY_NAMESPACE::with_energy<3>(material, [](auto energy) { return decltype(energy)::kBarrier; });
}

bool has_bulk_constant(const Material& material) {
  return HWY_NAMESPACE::with_energy<3>(material, [](auto energy) {
    return requires { energy.lambda; }
    || requires { energy.kappa; };
  });
}

std::string_view name(Energy energy) {
  for (const OptionInfo& option : option_table())
    if (option.name == "energy") return std::get<ChoiceMember>(option.member).words[static_cast<std::size_t>(energy)];
  return {};
}

}  // namespace varimesh
